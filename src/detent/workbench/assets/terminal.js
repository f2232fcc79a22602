// The page Terminal: rows of a line as they come, lines and scripts to send.

import { wordsOf } from "./forms.js";
import { Looking } from "./looking.js";
import { bytes } from "./typed_bytes.js";

const { part, on, frame, get, call, toast, failed, seconds, remembered, remember } = window.detent;

const MOST = 1500; // rows on the page
const EVERY = 150; // ms between two looks at a line
const MOST_SAID = 50;
const RAW = "raw";

part("terminal", (box) => {
  const facts = JSON.parse(box.dataset.lines);
  const names = Object.keys(facts);
  /** @param {string} name */
  const role = (name) => box.querySelector(`[data-role="${name}"]`);
  const rows = role("rows");
  const talk = box.querySelector(".talk");
  const text = role("text");
  const to = role("to");
  const script = role("script");
  const numbers = role("numbers");
  let line = names.includes(remembered("line")) ? remembered("line") : names[0];
  let next = 0;
  /** @type {number | null} */
  let cut = null;
  let chosen = 0; // counts the lines that were chosen
  let looked = 0;
  /** @type {number | null} */
  let seen = null;
  let timer = 0;
  let kept = 0;
  /** @type {[string, string, string] | null} a draft that is kept soon */
  let unkept = null;
  /** @type {string[]} */
  let said = [];
  let back = 0;
  let over = ""; // a file that is to be replaced

  // -- what was said --

  /** @param {any} one */
  function row(one) {
    const element = document.createElement("div");
    element.className = `said${one.sender ? "" : " host"}${one.wrong ? " wrong" : ""}`;
    element.dataset.number = one.number;
    const when = document.createElement("span");
    when.className = "when";
    when.textContent = seconds(one.begin);
    const who = document.createElement("span");
    who.className = "who";
    who.textContent = `${one.sender || "host"}:`; // who says it: an arrow was read either way
    const what = document.createElement("span");
    what.className = "what";
    for (const [kind, shown, meaning, hex] of one.parts) {
      const chip = document.createElement("span");
      chip.className = `chip ${kind}`;
      chip.textContent = shown;
      chip.dataset.help = `${meaning || kind} \u00b7 ${hex}`;
      const small = document.createElement("i");
      small.textContent = hex;
      chip.append(small);
      what.append(chip);
    }
    if (one.note) {
      const note = document.createElement("span");
      note.className = "note";
      note.textContent = one.note;
      what.append(note);
    }
    element.append(when, who, what);
    return element;
  }

  const atEnd = () => rows.scrollHeight - rows.scrollTop - rows.clientHeight < 40;

  function toEnd() {
    rows.scrollTop = rows.scrollHeight;
    talk.classList.remove("away");
  }

  const looking = new Looking(async () => {
    if (document.hidden) return;
    looked = performance.now();
    seen = get("now");
    const mine = chosen;
    try {
      let told = await call("terminal", line, next);
      if (mine !== chosen) return;
      if (cut !== null && told.cut !== cut) {
        next = 0;
        rows.replaceChildren();
        told = await call("terminal", line, 0);
        if (mine !== chosen) return;
      }
      cut = told.cut;
      const stay = !atEnd();
      for (let last; (last = rows.lastElementChild) && Number(last.dataset.number) >= told.first;) last.remove();
      for (const one of told.rows) rows.append(row(one));
      while (rows.children.length > MOST) rows.firstElementChild.remove();
      next = told.next;
      if (!rows.children.length && !rows.dataset.empty) rows.dataset.empty = "yes";
      if (!stay) toEnd();
      else talk.classList.toggle("away", rows.scrollHeight > rows.clientHeight && stay);
    } catch (error) {
      seen = null; // when there is a connection again, however the cell stands
      throw error;
    }
  });
  const look = () => looking.soon();

  function soon() {
    if (get("now") === seen || timer) return;
    const wait = Math.max(0, looked + EVERY - performance.now());
    timer = setTimeout(() => {
      timer = 0;
      look();
    }, wait);
  }

  /** @param {string} name */
  function choose(name) {
    keepNow();
    line = name;
    chosen += 1;
    remember("line", name);
    for (const tab of box.querySelectorAll("[data-line]")) tab.setAttribute("aria-selected", tab.dataset.line === name ? "true" : "false");
    for (const end of box.querySelectorAll("[data-ends]")) end.hidden = end.dataset.ends !== name;
    to.replaceChildren(...facts[name].units.map((/** @type {string} */ unit) => new Option(unit, unit)), new Option("bytes", RAW));
    const { host } = facts[name]; // a unit of the cell: nobody else may speak
    for (const one of [to, text, role("say").querySelector("button"), script]) one.disabled = host !== null;
    text.placeholder = host === null ? "Command" : `${host} is the host of this line: send to ${host}`;
    rows.replaceChildren();
    next = 0;
    cut = null;
    said = JSON.parse(remembered(`said.${name}`) || "[]");
    back = said.length;
    fillSaid();
    hint();
    showScript();
    progress();
    queue();
    look();
  }

  // -- what waits while the cell stands --

  function queue() {
    const mine = (get("queue") || []).filter((/** @type {any[]} */ one) => one[1] === line);
    const shelf = role("waits");
    shelf.hidden = !mine.length;
    shelf.replaceChildren(...mine.map((/** @type {[number, string, string, string]} */ [number, , unit, written]) => {
      const row = document.createElement("div");
      const who = document.createElement("span");
      who.className = "quiet";
      who.textContent = unit ? `waits, to ${unit}:` : "waits, bytes:";
      const what = document.createElement("b");
      what.className = "mono grow";
      what.textContent = written.replace(/[^ -~]/g, (one) => `\\x${one.charCodeAt(0).toString(16).padStart(2, "0")}`);
      const away = document.createElement("button");
      away.className = "key small";
      away.textContent = "Take back";
      away.setAttribute("aria-label", `Take back ${written}`);
      away.addEventListener("click", () => call("withdraw", number).catch(failed));
      row.append(who, what, away);
      return row;
    }));
  }

  // -- a line to send --

  function fillSaid() {
    box.querySelector("#said").replaceChildren(...[...new Set(said)].reverse().map((one) => new Option(one)));
  }

  function hint() {
    const here = role("hint");
    here.replaceChildren();
    if (facts[line].host !== null) return;
    if (to.value === RAW) {
      here.textContent = "Bytes as they are: \\r, \\n, \\t and \\xHH stand for what cannot be typed.";
      return;
    }
    const written = text.value.trim();
    const found = (facts[line].words[to.value] || []).find((/** @type {string[]} */ [spelling]) => written.startsWith(spelling));
    if (!found) {
      here.textContent = written ? "" : facts[line].added;
      return;
    }
    const [, ...rows] = found;
    rows.forEach((/** @type {string} */ row, /** @type {number} */ n) => {
      const name = document.createElement("b");
      const colon = row.indexOf(": ");
      name.textContent = row.slice(0, colon).trim();
      here.append(n ? " \u2002or\u2002 " : "", name, ` \u2002${row.slice(colon + 2)}`);
    });
    here.dataset.help = rows.join("\n");
  }

  role("say").addEventListener("submit", async (event) => {
    event.preventDefault();
    const written = text.value;
    if (!written) return;
    said = [...said.filter((one) => one !== written), written].slice(-MOST_SAID);
    back = said.length;
    remember(`said.${line}`, JSON.stringify(said));
    fillSaid();
    text.value = "";
    hint();
    const every = role("every").value;
    try {
      if (every && to.value !== RAW) await call("repeat_command", line, to.value, written, Number(every));
      else if (to.value === RAW) {
        await call("send", line, bytes(written));
        if (every) toast("Bytes are sent once: what is sent again and again is a command to a unit.");
      }
      else await call("type", to.value, written);
      toEnd();
      look();
    } catch (error) {
      failed(error);
      if (!text.value) text.value = written; // to be mended
    }
  });
  text.addEventListener("input", hint);
  to.addEventListener("change", hint);
  text.addEventListener("keydown", (event) => {
    const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!by || !said.length) return;
    event.preventDefault();
    back = Math.max(0, Math.min(said.length, back + by));
    text.value = said[back] || "";
    hint();
  });

  // -- a script --

  const draftName = () => `script.${line}`;
  let draftsAsked = 0;

  async function showScript() {
    const mine = ++draftsAsked;
    script.value = role("file").value = "";
    renumber();
    script.readOnly = true; // what is typed now the draft would overwrite
    const draft = await call("draft", draftName()).catch(() => null);
    if (mine !== draftsAsked) return; // another line is shown, or this one anew
    script.readOnly = false;
    if (!draft) return;
    script.value = draft.text;
    role("file").value = draft.file;
    renumber();
  }

  function renumber() {
    const count = script.value.split("\n").length;
    if (numbers.children.length !== count) {
      numbers.replaceChildren(...Array.from({ length: count }, (_, n) => {
        const one = document.createElement("div");
        one.textContent = String(n + 1);
        return one;
      }));
    }
    numbers.scrollTop = script.scrollTop;
  }

  function keep() {
    unkept = [draftName(), script.value, role("file").value];
    clearTimeout(kept);
    kept = setTimeout(keepNow, 400);
  }

  function keepNow() {
    clearTimeout(kept);
    if (unkept) call("keep_draft", ...unkept).catch(failed);
    unkept = null;
  }

  function progress() {
    const how = get(`script.${line}`) || { running: false, line: 0, told: "" };
    role("repeats").hidden = !(how.running && how.repeats);
    role("run").disabled = how.running || facts[line].host !== null;
    role("stop").disabled = !how.running;
    const told = role("told");
    told.textContent = how.running ? `sending line ${how.line}` : how.told;
    told.classList.toggle("bad", /^line \d/.test(how.told));
    [...numbers.children].forEach((one, n) => one.classList.toggle("at", n + 1 === how.line));
  }

  script.addEventListener("input", () => {
    renumber();
    keep();
  });
  script.addEventListener("scroll", () => (numbers.scrollTop = script.scrollTop));
  let starting = false;
  role("run").addEventListener("click", async () => {
    if (starting) return; // once more would begin it anew
    starting = true;
    const unit = to.value === RAW ? facts[line].units[0] : to.value;
    try {
      await call("run_script", line, unit, script.value).finally(() => (starting = false));
    } catch (error) {
      role("told").textContent = wordsOf(error);
      role("told").classList.add("bad");
    }
  });
  role("repeats").addEventListener("click", () => call("stop_script", line).catch(failed));
  role("stop").addEventListener("click", () => call("stop_script", line).catch(failed));
  role("file").addEventListener("focus", async () => {
    const files = await call("files", [".txt", ".script"]).catch(() => []);
    box.querySelector("#scripts").replaceChildren(...files.map((/** @type {string} */ name) => new Option(name)));
  });
  let opened = ""; // the text of the file, as it was opened or saved
  role("open").addEventListener("click", async () => {
    const before = script.value;
    const sure = role("open").textContent === "Replace";
    role("open").textContent = "Open";
    if (before.trim() && before !== opened && !sure) {
      role("open").textContent = "Replace";
      toast("The script that is written here is in no file: click once more to replace it.", "error");
      return;
    }
    try {
      const text = await call("read_file", role("file").value);
      if (script.value !== before) throw new Error("the script was changed meanwhile, so the file was not opened");
      script.value = opened = text;
      renumber();
      keep();
    } catch (error) {
      failed(error);
    }
  });
  role("save").addEventListener("click", async () => {
    try {
      const name = role("file").value;
      const text = script.value;
      const told = await call("write_file", name, text, null, over === name);
      over = told.asks ? name : "";
      if (told.saved) opened = text;
      role("save").textContent = over ? "Replace" : "Save";
      toast(told.asks || `Saved: ${told.saved}`, told.asks ? "error" : "note");
      if (told.saved) keep();
    } catch (error) {
      failed(error);
    }
  });

  role("file").addEventListener("input", () => {
    over = "";
    role("save").textContent = "Save";
    role("open").textContent = "Open";
  });

  role("hex").addEventListener("click", () => {
    const shown = !rows.classList.contains("with-hex");
    rows.classList.toggle("with-hex", shown);
    role("hex").setAttribute("aria-pressed", shown ? "true" : "false");
  });
  role("to-end").addEventListener("click", toEnd);
  rows.addEventListener("scroll", () => talk.classList.toggle("away", !atEnd()));
  for (const tab of box.querySelectorAll("[data-line]")) tab.addEventListener("click", () => choose(tab.dataset.line));

  const ends = [frame(soon), on("script.", progress), on("queue", queue)];
  document.addEventListener("visibilitychange", look); // it did not look while it was out of sight
  choose(line);
  return () => {
    ends.forEach((end) => end());
    document.removeEventListener("visibilitychange", look);
    clearTimeout(timer);
  };
});
