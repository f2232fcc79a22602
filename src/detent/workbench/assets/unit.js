// The page Unit: the unit that is chosen, filled into the markup of detent/workbench/pages/unit.py.

import { worded } from "./elements.js";
import { apart, remeasured, wholeSteps, wordsOf } from "./forms.js";
import { holding } from "./holding.js";
import { Looking } from "./looking.js";

const { part, on, get, call, meant, make, toast, failed, remembered, remember, seconds, grouped } = window.detent;

/** @typedef {[string, string | null, string, boolean]} Told name, value, where it is from, whether it is a lamp */

const MOST = 800; // rows on the page
const LONG = 300; // characters of what is told above the page
const ARMED = 3000; // ms in which a second click is a yes

part("unit", (box) => {
  const facts = JSON.parse(box.dataset.facts);
  /** @param {string} name */
  const role = (name) => box.querySelector(`[data-role="${name}"]`);
  /** @param {string} selector */
  const all = (selector) => [...box.querySelectorAll(selector)];
  const rows = role("rows");
  const form = role("connect");
  /** @type {string | null} a name; null: the form */
  let chosen = null;
  let scaled = 1; // steps in one of what the fields say
  let next = 0;
  let choices = 0; // counts the units that were chosen
  /** @type {{button: HTMLElement, text: string | null, timer: number} | null} a key that asks whether one is sure */
  let armed = null;
  let seen = "";

  const names = () => get("r.names") || [];
  const now = () => (chosen === null ? null : get(`r.${chosen}`));
  /** The unit that is shown; "" for none, which every call refuses. */
  const shown = () => chosen ?? "";
  /** @param {() => any} action */
  const tried = async (action) => {
    try {
      return await action();
    } catch (error) {
      failed(error);
      return undefined;
    }
  };

  /**
   * The first click asks, the second within three seconds does it.
   * @param {any} button
   * @param {string} why
   * @param {() => any} action
   */
  function sure(button, why, action) {
    if (armed && armed.button === button) {
      disarm();
      action();
      return;
    }
    disarm();
    armed = { button, text: button.textContent, timer: setTimeout(disarm, ARMED) };
    button.textContent = "Sure?";
    button.classList.add("armed");
    toast(why);
  }

  function disarm() {
    if (!armed) return;
    clearTimeout(armed.timer);
    armed.button.textContent = armed.text;
    armed.button.classList.remove("armed");
    armed = null;
  }

  // -- which unit --

  function tabs() {
    const there = names();
    if (chosen !== null && !there.includes(chosen)) choose(there[0] ?? null);
    else if (chosen === null && there.length && !box.dataset.asked) choose(there.includes(remembered("unit")) ? remembered("unit") : there[0]);
    role("tabs").replaceChildren(...there.map((/** @type {string} */ name) => tab(name, name)), tab(null, "Connect\u2026"));
    besides();
  }

  /**
   * @param {string | null} name
   * @param {string} text
   */
  function tab(name, text) {
    const made = worded("button", "", "");
    made.type = "button";
    made.setAttribute("role", "tab");
    made.setAttribute("aria-selected", name === chosen ? "true" : "false");
    made.append(worded("b", "", text));
    made.addEventListener("click", () => {
      box.dataset.asked = "yes";
      choose(name);
    });
    return made;
  }

  /**
   * What came of something that `who` was asked for, where it belongs; above the page where another unit is shown by then.
   * @param {string} who
   * @param {"sent" | "told"} place
   * @param {string} text
   */
  function came(who, place, text) {
    if (who === shown()) role(place).textContent = text;
    else toast(`${who}: ${text.length > LONG ? `${text.slice(0, LONG)}…` : text}`);
  }

  /** @param {string | null} name */
  function choose(name) {
    held.letGo();
    disarm();
    chosen = name;
    choices += 1;
    if (name !== null) remember("unit", name);
    form.hidden = name !== null;
    role("bench").hidden = name === null;
    rows.replaceChildren();
    next = 0;
    seen = "";
    for (const one of ["answers", "sent", "told"]) role(one).replaceChildren();
    role("restore").hidden = true;
    role("source").value = (name !== null && remembered(`source.${name}`)) || "";
    for (const one of role("tabs").children) one.setAttribute("aria-selected", one.textContent === (name ?? "Connect\u2026") ? "true" : "false");
    besides();
    measure();
    if (name === null) places();
    else show();
  }

  async function places() {
    const told = await tried(() => call("unit_places"));
    if (!told || chosen !== null) return;
    /**
     * @param {string} text
     * @param {string} more
     * @param {() => void} pick
     */
    const row = (text, more, pick) => {
      const made = worded("button", "key small", "");
      made.type = "button";
      made.append(worded("b", "mono", text), worded("span", "quiet", more));
      made.addEventListener("click", pick);
      return made;
    };
    /** @param {string} name */
    const field = (name) => form.elements[name];
    /**
     * @param {string} kind
     * @param {Part[]} made
     * @param {string} none
     */
    const fill = (kind, made, none) => role(kind).replaceChildren(...(made.length ? made : [worded("p", "quiet", none)]));
    fill("ports", told.ports.map((/** @type {string[]} */ [device, what]) => row(device, what, () => {
      field("address").value = device;
      field("address").focus();
    })), "No serial port is plugged in. A port of another computer is HOST:PORT, or rfc2217://HOST:PORT.");
    fill("cell", told.cell.map((/** @type {string[]} */ [name, model, address, options]) => row(name, `${model} at ${address} ${options}`, () => connect(model, address, options, `${name} (cell)`))),
      "No unit of this cell has an endpoint.");
    box.querySelector("#ports").replaceChildren(...told.ports.map((/** @type {string[]} */ [device, what]) => new Option(what, device)));
  }

  /**
   * @param {string} model
   * @param {string} address
   * @param {string} options
   */
  async function connect(model, address, options, name = "") {
    const made = await tried(() => call("unit_connect", model, address, options, name));
    if (made) choose(made);
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    connect(form.elements.model.value, form.elements.address.value.trim(), form.elements.options.value.trim());
  });
  const takes = () => {
    const options = facts[form.elements.model.value].options;
    role("takes").textContent = `It takes ${[...options, "baud", "data_bits", "parity", "stop_bits"].join(", ")}, each written NAME=VALUE.`;
  };
  form.elements.model.addEventListener("change", takes);
  takes();

  // -- the panel --

  const lead = () => (role("measure").value && Number(role("lead").value) > 0 ? Number(role("lead").value) : 0);

  function show() {
    const told = now();
    if (!told) return;
    role("name").textContent = chosen;
    const state = told.lost ? "port lost" : told.stopping ? "stopping" : told.state ?? "unknown";
    role("state").textContent = told.job ? `${state} \u00b7 ${told.job}${told.progress[1] ? ` ${told.progress[0]}/${told.progress[1]}` : ""}` : state;
    role("state").dataset.value = told.lost || told.trouble ? "bad" : told.moving ? "moving" : "";
    const trouble = role("trouble");
    const why = told.lost ? `The port is gone: ${told.lost}. Mend the cable, then connect again; nothing is sent until you do.`
      : told.trouble || (told.outcome.startsWith("STOP was not") ? told.outcome : "");
    trouble.hidden = !why;
    trouble.firstElementChild.textContent = why;
    role("again").textContent = told.lost ? "Connect again" : "Ask again";
    const unknown = told.position === null;
    role("position").textContent = unknown ? "unknown" : `${told.position > 0 ? "+" : ""}${grouped(told.position)}`;
    role("position").classList.toggle("unknown", unknown);
    role("steps").textContent = unknown ? (told.last === null ? "" : `last told: ${grouped(told.last)}`) : told.can.unit;
    role("place").textContent = !unknown && lead() ? `${(told.position / lead()).toFixed(3)} ${role("measure").value}` : "";
    const rate = told.moving === false ? null : told.rate; // a board at rest tells the rate from which it would begin
    role("rate").textContent = rate === null ? "" : grouped(Math.round(rate));
    role("rate-unit").textContent = rate === null ? "" : ` ${told.can.unit}/s`;
    role("speed-unit").textContent = `${told.can.unit}/s`;
    const print = JSON.stringify(told.facts);
    if (print !== seen) {
      seen = print;
      role("lamps").replaceChildren(...told.facts.filter((/** @type {Told} */ one) => one[3]).map(lamp));
      /** @param {any} one */
      role("facts").replaceChildren(...told.facts.filter((/** @type {Told} */ one) => !one[3]).flatMap((/** @type {Told} */ [name, value, source]) => {
        const words = worded("dd", value === null ? "unknown" : "mono", value === null ? "unknown" : value);
        words.dataset.help = source;
        return [worded("dt", "", name), words];
      }));
    }
    role("pause").setAttribute("aria-pressed", told.paused ? "true" : "false");
    if (document.activeElement !== role("rates")) role("rates").value = String(told.asking);
    role("took").textContent = told.lost ? "not asked: the port is gone" : told.paused ? "not asked: what is shown is what it told last"
      : told.trouble ? "asked less often while it does not answer" : `asked ${told.asking}\u00d7 a second; ${Math.round(told.took * 1000)} ms each`;
    hands(told);
    const program = facts[told.model] && !["bs0610", "bs0710", "supersigma"].includes(told.model);
    role("program").hidden = !program;
    box.querySelector(".keeps").hidden = told.model === "supersigma";
    looking.soon();
  }

  /** @param {Told} told */
  function lamp([name, value, source]) {
    const made = worded("span", value === null ? "lamp unknown" : "lamp");
    made.dataset.value = value === null ? "" : value;
    made.dataset.help = `${name}: ${value === null ? "unknown" : value} (${source})`;
    made.append(worded("i", "led"), worded("span", "", name), worded("b", "num", value === null ? "?" : value));
    return made;
  }

  role("again").addEventListener("click", () => tried(() => call("unit_again", shown())));
  role("leave").addEventListener("click", (event) => {
    const leave = () => tried(() => call("unit_leave", shown()));
    if (now().moving === false) leave();
    else sure(event.currentTarget, `Click once more: ${now().moving ? "it moves" : "it may move"}, and STOP does not reach it then.`, leave);
  });
  const paused = () => meant(`r.${chosen}.paused`, now().paused);
  /** @param {boolean} pause */
  const ask = (pause) => make(`r.${chosen}.paused`, pause, () => tried(() => call("unit_asking", shown(), pause, Number(role("rates").value))));
  role("pause").addEventListener("click", () => ask(!paused()));
  role("rates").addEventListener("change", () => ask(paused()));

  // -- hands --

  /** @param {any} told */
  function hands(told) {
    const busy = Boolean(told.job || told.lost || told.stopping);
    for (const one of all(".hand [data-jog], .hand [data-role=go], .hand [data-role=zero]")) one.disabled = busy;
    role("home").disabled = busy || told.can.home !== "";
    for (const one of all("[data-hold]")) one.disabled = told.can.hold !== "" || (busy && !told.held);
    role("why").textContent = [told.can.hold, told.can.home, told.can.before_hold && `Hold: ${told.can.before_hold}`, told.can.before_home && `Home: ${told.can.before_home}`].filter(Boolean).join(" ");
  }

  function measure() {
    const kept = JSON.parse(remembered(`lead.${chosen}`) || "null");
    role("measure").value = kept ? kept[0] : "";
    role("lead").value = kept ? kept[1] : 1;
    [role("by").value, role("target").value, scaled] = ["100", "0", 1]; // what was written is of the unit before
    measured();
  }

  /** The fields say the same lengths by another measure: nothing goes farther because it is chosen. */
  function measured() {
    for (const one of ["by", "target"]) role(one).value = remeasured(role(one).value, scaled, lead() || 1);
    scaled = lead() || 1;
    role("lead-label").hidden = !role("measure").value;
    role("lead-unit").textContent = role("measure").value;
    for (const one of ["by", "target"]) role(one).dataset.unit = role("measure").value || "steps";
  }

  for (const one of ["measure", "lead"]) role(one).addEventListener("change", () => {
    measured();
    if (!role("measure").value || lead()) remember(`lead.${chosen}`, JSON.stringify([role("measure").value, role("lead").value]));
    show();
  });

  /**
   * What a field says, in whole steps; null with a word where it is no number.
   * @param {string} name
   */
  function steps(name) {
    const value = Number(role(name).value);
    if (role(name).value === "" || !Number.isFinite(value)) {
      toast("Write a number first.", "error");
      return null;
    }
    if (role("measure").value && !lead()) {
      toast(`Write first how many steps a ${role("measure").value} is, a number above 0.`, "error");
      return null;
    }
    try {
      return wholeSteps(value * (lead() || 1));
    } catch (error) {
      failed(error);
      return null;
    }
  }

  /**
   * @param {"jog" | "go" | "zero" | "home"} what
   * @param {number} value
   */
  async function hand(what, value) {
    const who = shown();
    const sent = await tried(() => call("unit_move", who, what, value));
    if (sent) came(who, "sent", sent.length ? `sent ${sent.join(", ")}` : "nothing had to be sent");
  }

  for (const button of all("[data-jog]")) button.addEventListener("click", () => {
    const by = steps("by");
    if (by !== null) hand("jog", by * Number(button.dataset.jog));
  });
  role("go").addEventListener("click", () => {
    const to = steps("target");
    if (to !== null) hand("go", to);
  });
  role("zero").addEventListener("click", (event) => sure(event.currentTarget, "Click once more: where the axis stands is 0 then.", () => hand("zero", 0)));
  role("home").addEventListener("click", (event) => sure(event.currentTarget, `Click once more: the axis goes until it meets a switch. ${now().can.before_home}`,
    () => hand("home", Number(role("direction").value))));
  role("stop").addEventListener("click", () => stopped(shown(), call("unit_stop", shown())));

  /**
   * @param {string} who
   * @param {Promise<string>} stopping
   */
  async function stopped(who, stopping) {
    document.dispatchEvent(new CustomEvent("detent-stopping", { detail: { who, stopping } }));
    held.letGo(false);
    const told = await stopping.catch(() => ""); // it stands above the page
    if (told) came(who, "sent", told);
  }

  const held = holding(all("[data-hold]"), {
    name: () => chosen ?? "",
    rate: (button) => {
      const speed = Number(role("speed").value);
      if (speed > 0) return speed * Number(button.dataset.hold);
      toast("Write a rate first.", "error");
      return null;
    },
    sent: (lines, who) => came(who, "sent", `sent ${lines.join(", ")}`),
    stopped,
  });

  // -- the line --

  /** @param {any} one */
  function row(one) {
    const made = worded("div", `said${one.sender ? "" : " host"}${one.wrong ? " wrong" : ""}${one.question ? " question" : ""}`);
    made.dataset.number = one.number;
    made.append(worded("span", "when", seconds(one.begin)), worded("span", "who", one.sender ? "unit:" : "host:"));
    const what = worded("span", "what");
    for (const [kind, shown, meaning, hex] of one.parts) {
      const chip = worded("span", `chip ${kind}`, shown);
      chip.dataset.help = `${meaning || kind} \u00b7 ${hex}`;
      chip.append(worded("i", "", hex));
      what.append(chip);
    }
    if (one.note) what.append(worded("span", "note", one.note));
    made.append(what);
    return made;
  }

  const looking = new Looking(async () => {
    const mine = choices;
    const told = await call("unit_talk", shown(), next);
    if (mine !== choices) return;
    const stay = rows.scrollHeight - rows.scrollTop - rows.clientHeight > 40;
    for (let last; (last = rows.lastElementChild) && Number(last.dataset.number) >= told.first;) last.remove();
    rows.append(...told.rows.map(row));
    while (rows.children.length > MOST) rows.firstElementChild.remove();
    next = told.next;
    if (!stay) rows.scrollTop = rows.scrollHeight;
  });

  function besides() {
    const select = role("beside");
    const before = select.value;
    const others = names().filter((/** @type {string} */ name) => name !== chosen);
    select.replaceChildren(new Option("to it alone", ""), ...others.map((/** @type {string} */ name) => new Option(`and to ${apart(name, chosen ?? "")}`, name)));
    select.value = others.includes(before) ? before : "";
    select.hidden = !others.length;
  }

  function hint() {
    const told = now();
    const written = role("text").value.trim();
    const found = told && (facts[told.model].words || []).find((/** @type {string[]} */ [spelling]) => written && written.startsWith(spelling));
    role("hint").textContent = found ? found.slice(1).join("   or   ") : written ? "" : "What the protocol adds is added: checksum, end, name, the echo of each character.";
  }

  role("text").addEventListener("input", hint);
  role("say").addEventListener("submit", async (event) => {
    event.preventDefault();
    const line = role("text").value.trim();
    if (!line) return;
    role("text").value = "";
    hint();
    const other = role("beside").value;
    const who = shown();
    const told = await tried(() => (other ? call("unit_both", [who, other], line) : call("unit_say", who, line)));
    if (who !== shown()) return; // another unit is shown by now: an error was told, and what was said is on its line
    if (!told) {
      if (!role("text").value) role("text").value = line; // to be mended
      return;
    }
    answers(line, Array.isArray(told) ? told : [told]);
  });

  /**
   * @param {string} line
   * @param {any} told
   */
  function answers(line, told) {
    const table = worded("table", "");
    for (const one of told) {
      const made = worded("tr", one.refused ? "wrong" : "");
      made.append(worded("td", "quiet", one.unit), worded("td", "mono", one.answers.join("  ") || "\u2013"), worded("td", "", one.meaning),
        worded("td", "num", one.ms === null ? "" : `${one.ms} ms`));
      table.append(made);
    }
    const parts = [worded("div", "asked", ""), table];
    parts[0].append(worded("b", "mono", line));
    if (told.length > 1) {
      const same = JSON.stringify(told[0].answers) === JSON.stringify(told[1].answers) && told[0].refused === told[1].refused;
      const by = told[0].ms !== null && told[1].ms !== null ? `, ${Math.abs(told[0].ms - told[1].ms).toFixed(1)} ms between them` : "";
      const silent = told.every((/** @type {any} */ one) => !one.answers.length && one.refused);
      parts[0].append(silent ? worded("span", "differ", " neither has answered")
        : worded("span", same ? "same" : "differ", same ? ` the same answers${by}` : ` they differ${by}`));
    }
    role("answers").replaceChildren(...parts);
  }

  role("hex").addEventListener("click", () => toggle("hex", "with-hex"));
  role("polls").addEventListener("click", () => toggle("polls", "with-polls"));
  /**
   * @param {string} name
   * @param {string} style
   */
  function toggle(name, style) {
    const on = rows.classList.toggle(style);
    role(name).setAttribute("aria-pressed", on ? "true" : "false");
  }

  // -- program and backup --

  /** @param {string} text */
  const tell = (text, who = shown()) => came(who, "told", text);
  const source = () => role("source").value;
  const keep = () => remember(`source.${shown()}`, source()); // what is written for a unit is found again, and is no other's
  role("source").addEventListener("input", keep);

  role("read").addEventListener("click", async () => {
    const read = async () => {
      const before = source();
      const mine = shown();
      const text = await tried(() => call("unit_source", mine));
      if (text === undefined) return;
      if (mine !== shown()) {
        toast(`The program of ${mine} was read, but another unit is shown by now: read it again.`);
        return;
      }
      if (source() !== before) {
        tell("The text here was changed meanwhile, so it was not replaced by the program of the unit.");
        return;
      }
      role("source").value = text;
      keep();
      tell(text.trim() ? "read from the unit" : "the unit holds no program");
    };
    if (source().trim()) sure(role("read"), "Click once more: what is written here is replaced.", read);
    else read();
  });
  role("compare").addEventListener("click", async () => {
    const who = shown();
    const lines = await tried(() => call("unit_compare", who, source()));
    if (lines) tell(lines.length ? lines.join("\n") : "the unit holds this program", who);
  });
  role("store").addEventListener("click", (event) => sure(event.currentTarget, "Click once more: the program in the unit is replaced by this one. It is not started.", async () => {
    const who = shown();
    const told = await tried(() => call("unit_store", who, source(), role("save").checked));
    if (told) tell(told, who);
  }));

  const file = () => role("file").value.trim() || `${now().model}-backup.toml`;
  role("file").addEventListener("focus", async () => {
    const files = await call("files", [".toml"]).catch(() => []);
    box.querySelector("#backups").replaceChildren(...files.map((/** @type {string} */ name) => new Option(name)));
  });
  role("file").addEventListener("input", () => (role("restore").hidden = true));
  role("backup").addEventListener("click", async () => {
    const name = file();
    const who = shown();
    role("file").value = name;
    try {
      tell(`Wrote ${await call("unit_backup", who, name, false)}`, who);
    } catch (error) {
      if (!/there already/.test(wordsOf(error)) || who !== shown()) failed(error);
      else sure(role("backup"), `${name} is there already. Click once more to replace it.`, async () => {
        const told = await tried(() => call("unit_backup", who, name, true));
        if (told) tell(`Wrote ${told}`, who);
      });
    }
  });
  let differed = "";
  role("differs").addEventListener("click", async () => {
    const who = shown();
    const name = file();
    const told = await tried(() => call("unit_differs", who, name));
    if (!told) return;
    if (who !== shown() || name !== file()) {
      toast(`${who} was compared with ${name}, but another unit or file is chosen by now: look again.`);
      return;
    }
    differed = told.seen;
    role("restore").hidden = !told.lines.length;
    tell(told.lines.length ? told.lines.join("\n") : "Nothing differs: the unit holds what the file says.");
  });
  role("restore").addEventListener("click", async () => {
    role("restore").hidden = true;
    const who = shown();
    const told = await tried(() => call("unit_restore", who, file(), differed));
    if (told) tell(told.join("\n"), who);
  });

  const ends = [
    on("r.", (key) => {
      if (key === "r.names") tabs();
      else if (key === `r.${chosen}`) show();
    }),
  ];
  tabs();
  if (chosen === null) choose(null);
  return () => {
    held.end();
    ends.forEach((end) => end());
  };
});
