/* The Program page: the text of a unit's program, its memory, and the debugger. What it knows of the language, and
   every check, comes from the server (detent/workbench/editing.py). */

import { wordsOf } from "./forms.js";
import { makeEditor } from "./program_editor.js";

const CHECK_AFTER = 180,
  KEEP_AFTER = 400; // ms behind the last change

/** @type {Record<string, string>} */
const KEYS = { F9: "break", F10: "step", "Shift-F10": "back", F4: "cursor" }; // F8 is everywhere: workbench.js

class Program {
  /** @param {Part} root */
  constructor(root) {
    this.root = root;
    /** @type {ProgramFacts & {draft: string}} of the unit that is shown: none before `show` */
    this.facts = /** @type {any} */ (null);
    this.file = "";
    /** @type {string | null} the text as it is in the file, or in the cell's own source; null: not known */
    this.saved = "";
    /** @type {CheckedProgram | null} */
    this.checked = null;
    /** @type {number[]} lines that memory has otherwise */
    this.different = [];
    /** @type {(End | void)[]} */
    this.ends = [];
    /** @type {any} an Editor, once it is open */
    this.editor = null;
    /** @type {Map<number, number>} address -> line */
    this.lines = new Map();
    /** @type {Map<number, number>} line -> address */
    this.addresses = new Map();
    this.ahead = false; // breakpoints were set in a text that is not loaded yet
    this.how = ""; // what was shown of a script
    this.showing = 0; // counts the units that were asked for: the last one counts
    this.shown = Promise.resolve(); // the one that is asked for stands there
    this.seen = ""; // of what the running line was shown for
    const find = (/** @type {string} */ selector) => root.querySelector(selector);
    this.at = {
      file: find(".program-file"),
      errors: find(".program-errors"),
      used: find(".program-used"),
      meter: find(".program-meter"),
      loaded: find(".program-loaded"),
      line: find(".program-line"),
      why: find(".program-why"),
      dialog: find("dialog"),
    };
    for (const tab of root.querySelectorAll("[data-unit]"))
      tab.addEventListener("click", () => this.turnTo(tab.dataset.unit));
    for (const key of root.querySelectorAll("[data-key]"))
      key.addEventListener("click", () => this.press(() => this.actions[key.dataset.key]()));
    find(".program-commands input").addEventListener("input", () => this.facts && this.commands());
    find("[value=cancel]").addEventListener("click", () => this.at.dialog.close());
  }

  async open() {
    this.editor = await makeEditor(this.root.querySelector(".program-editor"), {
      changed: (/** @type {boolean} */ typed) => this.changed(typed),
      toggled: (/** @type {number} */ line) => this.press(() => this.toggleBreakpoint(line)),
      keys: {
        "Mod-s": () => this.press(() => this.actions.save()),
        "Mod-Enter": () => this.press(() => (this.facts.language ? this.actions.run() : this.actions.send())),
        F8: () => detent.turnTime(),
        F9: () => this.press(() => this.actions.break()),
        F10: () => this.press(() => this.actions.step()),
        "Shift-F10": () => this.press(() => this.actions.back()),
        F4: () => this.press(() => this.actions.cursor()),
      },
    });
    const units = [...this.root.querySelectorAll("[data-unit]")].map((tab) => tab.dataset.unit);
    const last = detent.remembered("program.unit");
    this.ends.push(detent.frame(() => this.look()), this.listenForKeys());
    if (units.length) this.turnTo(units.includes(last) ? last : units[0]);
  }

  /** @param {string} unit */
  turnTo(unit) {
    this.shown = this.show(unit);
  }

  /**
   * A key was pressed: it acts on the unit that is asked for, once that is there.
   * @param {() => any} action
   */
  async press(action) {
    await this.shown;
    if (this.facts && !this.closed) await action();
  }

  /* The keys of the page, wherever the focus is; in the editor they are its own. */
  listenForKeys() {
    /** @param {any} event */
    const pressed = (event) => {
      if (event.defaultPrevented || event.altKey || this.at.dialog.open) return;
      if (event.target.closest && event.target.closest("[role=dialog]")) return;
      const control = event.ctrlKey || event.metaKey;
      const name = control && event.key.toLowerCase() === "s" ? "save" : control ? null : KEYS[(event.shiftKey ? "Shift-" : "") + event.key];
      if (!name) return;
      event.preventDefault();
      if (!event.repeat || name === "step" || name === "back") this.press(() => this.actions[name]());
    };
    document.addEventListener("keydown", pressed);
    return () => document.removeEventListener("keydown", pressed);
  }

  close() {
    this.flush();
    for (const end of this.ends) if (typeof end === "function") end();
    this.closed = true;
    if (this.editor) this.editor.close();
  }

  /* -- the unit and its text -------------------------------------------------------------------------------- */

  /** @param {string} unit */
  async show(unit) {
    const mine = (this.showing += 1);
    delete this.root.dataset.checked;
    const about = await this.ask("program_about", unit);
    if (!about || this.closed || mine !== this.showing) return;
    const facts = { ...about, draft: about.language ? unit : `script.${about.line}` }; // a script is that of the Terminal page
    this.flush(); // what was typed so far is of the unit before, whose draft it is
    const draft = await this.ask("draft", facts.draft);
    if (this.closed || mine !== this.showing) return;
    this.flush();
    this.facts = facts;
    detent.remember("program.unit", unit);
    for (const tab of this.root.querySelectorAll("[data-unit]"))
      tab.setAttribute("aria-selected", String(tab.dataset.unit === unit));
    for (const watch of this.root.querySelectorAll("[data-watch]")) watch.hidden = watch.dataset.watch !== unit;
    for (const box of this.root.querySelectorAll("[data-for]"))
      box.hidden = (box.dataset.for === "language") !== facts.language;
    this.root.classList.toggle("no-language", !facts.language);
    this.root.querySelector("[data-key=keep]").hidden = this.root.querySelector("[data-key=compare-kept]").hidden =
      !facts.nonvolatile;
    this.at.why.textContent =
      `A ${facts.model} holds no programs. Write lines to send to it instead: ` +
      "\u201c@ 500 ms\u201d is a pause, \u201c@ answer\u201d waits for an answer.";
    this.file = draft ? draft.file : "";
    this.saved = this.file ? null : facts.source; // of a file that has not been read it is not known
    this.checked = null;
    this.different = [];
    this.ahead = false;
    this.editor.speak(facts);
    this.commands();
    this.editor.set(draft ? draft.text : facts.source);
    this.editor.breakAt([]);
    this.say("");
    this.name();
    await this.check();
  }

  /* The commands of the unit that say what is searched for. */
  commands() {
    const box = this.root.querySelector(".program-commands"),
      wanted = box.querySelector("input").value.toLowerCase().split(/\s+/).filter(Boolean),
      rows = [...new Map(this.facts.words.flatMap((word) => word.rows).map((row) => [JSON.stringify(row), row])).values()],
      found = rows.filter((row) => wanted.every((/** @type {string} */ word) => [row.form, row.takes, row.what, row.section].join(" ").toLowerCase().includes(word)));
    box.querySelector("table").replaceChildren(
      ...found.map((row) => {
        const made = document.createElement("tr");
        for (const [kind, text] of [["mono", row.form], ["", `${row.what}${row.takes && !/^no/.test(row.takes) ? ` Takes ${row.takes}.` : ""}`], ["quiet", row.section]]) {
          const cell = document.createElement("td");
          cell.className = kind;
          cell.textContent = text;
          made.append(cell);
        }
        return made;
      }),
    );
    if (!found.length) box.querySelector("table").append("No command says that.");
  }

  /** @param {boolean} typed */
  changed(typed) {
    if (!this.facts) return;
    this.different = [];
    clearTimeout(this.checkSoon);
    this.checkSoon = setTimeout(() => this.check(), CHECK_AFTER);
    if (!typed) return;
    if (this.told === "bad") this.say(""); // of the text as it was
    clearTimeout(this.keepSoon);
    this.keepSoon = setTimeout(() => this.flush(), KEEP_AFTER);
    this.unkept = this.facts.draft;
    this.root.dataset.draft = "changed";
    this.name();
  }

  /* Keep the draft now. */
  flush() {
    clearTimeout(this.keepSoon);
    if (!this.unkept) return;
    const draft = this.unkept;
    this.unkept = null;
    detent.call("keep_draft", draft, this.editor.text, this.file).then(
      () => {
        if (!this.unkept) this.root.dataset.draft = "kept";
      },
      (error) => detent.toast(`The draft is not kept: ${wordsOf(error)}`, "error"),
    );
  }

  name() {
    const dirty = this.saved === null || this.editor.text !== this.saved;
    this.at.file.textContent =
      (this.file || (this.facts.source ? "of the cell" : "no file")) + (dirty ? " \u2022" : "");
    this.at.file.title = dirty ? "changed, kept as a draft" : "";
  }

  async check() {
    const { unit, language } = this.facts;
    if (!language) {
      this.at.errors.replaceChildren();
      return;
    }
    const text = this.editor.text,
      found = await this.ask("program_check", unit, text);
    if (!found || this.closed || this.facts.unit !== unit || this.editor.text !== text) return;
    const first = this.checked === null || (found.loaded && !this.checked.loaded);
    this.checked = found;
    this.memory = detent.get(`u.${unit}.memory`);
    this.lines = new Map(found.places.map(([line, address]) => [address, line]));
    this.addresses = new Map(found.places.map(([line, address]) => [line, address]));
    this.editor.check(found);
    this.at.errors.replaceChildren(
      ...found.errors.map(([line, column, , message]) => {
        const button = document.createElement("button"),
          item = document.createElement("li"),
          where = document.createElement("b");
        button.type = "button";
        where.textContent = `${line}:${column}`;
        button.append(where, ` ${message}`);
        button.addEventListener("click", () => this.editor.goTo(line, column));
        item.append(button);
        return item;
      }),
    );
    const part = found.used / found.capacity;
    this.at.used.textContent = `${found.used} of ${found.capacity} bytes`;
    this.at.meter.style.setProperty("--part", String(Math.min(part, 1)));
    this.at.meter.setAttribute("aria-valuenow", String(found.used));
    this.at.meter.setAttribute("aria-valuemax", String(found.capacity));
    this.at.meter.classList.toggle("full", part > 1);
    this.at.loaded.textContent = found.errors.length
      ? `${found.errors.length} error${found.errors.length > 1 ? "s" : ""}`
      : found.loaded
        ? "as in program memory"
        : "not in program memory";
    this.at.loaded.classList.toggle("good", found.loaded);
    this.root.dataset.checked = found.errors.length ? "errors" : found.loaded ? "loaded" : "sound";
    if (first && found.loaded) {
      if (this.ahead) this.setBreakpoints(this.editor.breakLines);
      else this.takeBreakpoints();
    }
    this.seen = "";
    this.look();
  }

  /* -- the debugger --------------------------------------------------------------------------------------------- */

  /* Show what the cell does, at each push. */
  look() {
    if (!this.facts || this.closed) return;
    const key = `u.${this.facts.unit}`,
      get = (/** @type {string} */ name) => detent.get(`${key}.${name}`);
    this.registers();
    this.script();
    const held = detent.get("held"),
      address = get("address"),
      memory = get("memory"),
      breaks = JSON.stringify(detent.meant(this.breaksKey) || []);
    const go = this.root.querySelector("[data-key=go] span"),
      word = held ? "Go" : "Pause";
    if (go.textContent !== word) go.textContent = word;
    if (this.checked && memory !== this.memory) {
      this.memory = memory;
      this.check();
    }
    const seen = `${held} ${address} ${this.checked && this.checked.loaded} ${this.different}`;
    if (seen !== this.seen && this.facts.language) {
      this.seen = seen;
      const line =
        this.checked && this.checked.loaded && address !== null && address !== undefined
          ? (this.lines.get(address) ?? null)
          : null;
      this.editor.spot(line, held, this.different);
      if (line !== null && held) this.editor.reveal(line);
      this.at.line.textContent =
        address === null || address === undefined ? "no program runs" : `${address}  ${get("running")}`;
      this.root.dataset.line = line === null ? "" : line;
    }
    if (this.checked && this.checked.loaded && !this.ahead && breaks !== this.breaks) this.takeBreakpoints();
  }

  /* How far a script is. */
  script() {
    if (this.facts.language) return;
    const how = detent.get(`script.${this.facts.line}`) || { running: false, line: 0, told: "" },
      text = JSON.stringify(how);
    if (text === this.how) return;
    this.how = text;
    this.root.querySelector("[data-key=stop]").disabled = !how.running;
    this.editor.spot(how.running ? how.line : null, false, []);
    this.say(
      how.running ? `line ${how.line}` : how.told === "done" ? "Sent. The answers are on the Terminal page." : how.told,
      how.told && how.told !== "done" ? "warn" : "",
    );
  }

  registers() {
    const list = this.root.querySelector(`[data-registers="${CSS.escape(this.facts.unit)}"]`);
    const values = Object.entries(detent.get(`u.${this.facts.unit}.reg`) || {}),
      text = JSON.stringify(values);
    if (!list || list.dataset.text === text) return;
    list.dataset.text = text;
    list.replaceChildren(
      ...values.flatMap(([name, value]) =>
        ["dt", "dd"].map((tag, i) => {
          const cell = document.createElement(tag);
          cell.textContent = [name, value][i];
          return cell;
        }),
      ),
    );
  }

  /* Show the breakpoints that the cell has, or will have when what was asked for is done. */
  takeBreakpoints() {
    const addresses = detent.meant(this.breaksKey) || [];
    this.breaks = JSON.stringify(addresses);
    this.ahead = false;
    this.editor.breakAt(
      addresses
        .map((/** @type {number} */ address) => this.lines.get(address))
        .filter(Boolean)
        .sort((/** @type {number} */ a, /** @type {number} */ b) => a - b),
    );
  }

  get breaksKey() {
    return `u.${this.facts.unit}.breaks`;
  }

  /**
   * Somebody wants a breakpoint at a line, or its instruction, or none where one is.
   * @param {number} line
   */
  toggleBreakpoint(line) {
    if (!this.facts.language) return;
    const place = this.placed(line),
      address = place === undefined ? place : this.addresses.get(place),
      { breakLines } = this.editor;
    if (!this.checked || !this.checked.loaded || address === undefined) {
      const at = breakLines.includes(place) ? place : line;
      this.setBreakpoints(breakLines.includes(at) ? breakLines.filter((/** @type {number} */ other) => other !== at) : [...breakLines, at]);
      return;
    }
    const { unit } = this.facts,
      before = detent.meant(this.breaksKey) || [],
      on = !before.includes(address),
      after = on ? [...before, address].sort((a, b) => a - b) : before.filter((/** @type {number} */ other) => other !== address);
    detent.make(this.breaksKey, after, () => this.ask("program_breakpoint", unit, address, on));
    this.takeBreakpoints();
  }

  /**
   * The line of the instruction at this line, or of the next one behind it.
   * @param {number} line
   */
  placed(line) {
    return [...this.addresses.keys()].sort((a, b) => a - b).find((place) => place >= line);
  }

  /**
   * These lines, and no others, have breakpoints from now on: those on no instruction go to the next one.
   * @param {number[]} lines
   */
  setBreakpoints(lines) {
    if (!this.checked || !this.facts.language) {
      this.editor.breakAt([]);
      return;
    }
    const moved = [...new Set(lines.flatMap((line) => this.placed(line) ?? []))].sort((a, b) => a - b);
    this.editor.breakAt(moved);
    this.ahead = !this.checked.loaded; // set in a text that is not loaded yet
    if (this.ahead) this.say("Breakpoints are in force once this text is loaded.");
    else {
      const addresses = moved.flatMap((line) => this.addresses.get(line) ?? []).sort((a, b) => a - b),
        { unit } = this.facts;
      detent.make(this.breaksKey, addresses, () => this.ask("program_breaks", unit, addresses));
      this.takeBreakpoints();
    }
  }

  /* -- what the keys do ------------------------------------------------------------------------------------------- */

  /** @returns {Record<string, () => any>} by their `data-key` */
  get actions() {
    const { facts, editor } = this,
      unit = facts && facts.unit;
    /** @param {boolean} start */
    const load = async (start) => {
      const lines = editor.breakLines,
        told = await this.ask("program_load", unit, editor.text, start);
      if (told === undefined) return;
      this.say(told, "good");
      await this.check();
      if (this.checked && this.checked.loaded) this.setBreakpoints(lines);
    };
    /** @param {boolean} kept */
    const compare = async (kept) => {
      const found = await this.ask("program_compare", unit, editor.text, kept);
      if (!found) return;
      this.different = found.lines;
      this.say(found.words, found.same ? "good" : "warn");
      this.look();
      if (found.lines.length) editor.reveal(found.lines[0]);
    };
    return {
      run: () => load(true),
      load: () => load(false),
      keep: async () => this.say((await this.ask("program_save", unit)) ?? "", "good"),
      compare: () => compare(false),
      "compare-kept": () => compare(true),
      fetch: async () => {
        const text = await this.ask("program_fetch", unit, false);
        if (text !== undefined) this.replace(text, this.file);
      },
      revert: async () => {
        const changed = editor.text !== facts.source;
        this.unkept = null;
        if ((await this.ask("forget_draft", facts.draft)) === undefined) return;
        this.file = "";
        this.saved = facts.source;
        editor.set(facts.source);
        this.name();
        this.say(changed ? "As it was. Ctrl-Z in the text brings back what you had written." : "Nothing was changed.");
      },
      open: () =>
        this.chooseFile("Open", "Open", async (/** @type {string} */ name) => {
          const text = await this.ask("read_file", name);
          if (text === undefined) return false;
          if (this.facts !== facts) return true;
          this.saved = text;
          this.replace(text, name);
          return true;
        }),
      save: () =>
        this.chooseFile("Save in the chosen folder", "Save", async (/** @type {string} */ name, /** @type {boolean} */ over) => {
          const text = editor.text,
            told = await this.ask("write_file", name, text, name === this.file ? this.saved : null, over);
          if (told === undefined) return false;
          if (told.asks) return told.asks;
          detent.toast(`Saved: ${told.saved}`);
          if (this.facts !== facts) return true; // another unit is shown by now
          this.file = name;
          this.saved = text;
          this.unkept = facts.draft;
          this.flush();
          this.name();
          return true;
        }),
      go: () => detent.turnTime(),
      step: () => this.ask("step_instruction", unit),
      back: () => this.ask("step_back", unit),
      cursor: () => {
        const lines = this.checked ? [...this.addresses.keys()].sort((a, b) => a - b) : [],
          address = this.addresses.get(lines.find((line) => line >= editor.line) ?? 0);
        if (address === undefined) detent.toast("There is no instruction at the cursor or behind it.", "error");
        else if (!this.checked?.loaded) detent.toast("Load the program first.", "error");
        else this.ask("program_run_to", unit, address);
      },
      break: () => this.toggleBreakpoint(editor.line),
      errors: () => {
        const on = !detent.meant("breakerrors");
        return detent.make("breakerrors", on, () => this.ask("break_on_errors", on));
      },
      send: () => this.ask("run_script", facts.line ?? "", unit, editor.text),
      "send-line": () => this.ask("run_script", facts.line ?? "", unit, editor.text.split("\n")[editor.line - 1]),
      stop: () => this.ask("stop_script", facts.line ?? ""),
    };
  }

  /**
   * Another text in place of this one; it is kept as a draft.
   * @param {string} text
   * @param {string} file
   */
  replace(text, file) {
    this.file = file;
    this.editor.set(text);
    this.unkept = this.facts.draft;
    this.flush();
    this.name();
  }

  /**
   * @param {string} title
   * @param {string} word
   * @param {(name: string, over: boolean) => Promise<boolean | string>} action
   */
  async chooseFile(title, word, action) {
    const names = await this.ask("files", []);
    if (!names) return;
    const { dialog } = this.at,
      form = dialog.firstElementChild,
      list = dialog.querySelector("ul"),
      { name } = form.elements;
    dialog.querySelector("h2").textContent = title;
    dialog.querySelector("[type=submit]").textContent = word;
    name.value = this.file || (word === "Save" ? this.facts.file || `${this.facts.unit}.txt` : "");
    const submit = dialog.querySelector("[type=submit]"),
      asks = dialog.querySelector(".program-asks");
    let over = "";
    const settle = () => {
      over = "";
      asks.textContent = "";
      submit.textContent = word;
    };
    settle();
    name.oninput = settle;
    list.replaceChildren(
      ...names.map((/** @type {string} */ file) => {
        const item = document.createElement("li"),
          button = document.createElement("button");
        button.type = "button";
        button.className = "mono";
        button.textContent = file;
        button.addEventListener("click", () => {
          name.value = file;
          settle();
        });
        button.addEventListener("dblclick", () => form.requestSubmit());
        item.append(button);
        return item;
      }),
    );
    const mine = (this.choosing = {});
    let under = false, // one at a time
      again = false; // it was asked for meanwhile
    form.onsubmit = async (/** @type {Event} */ event) => {
      event.preventDefault();
      const asked = name.value;
      if (under) again = true;
      if (!asked || under) return;
      under = true;
      again = false;
      const done = await action(asked, over === asked).finally(() => (under = false));
      if (this.choosing !== mine) return; // the dialog was opened for something else meanwhile
      if (typeof done === "string") {
        if (name.value !== asked) {
          if (again) form.requestSubmit(); // for the file that is named by now; never the answer to a question unseen
          return;
        }
        over = asked;
        asks.textContent = done;
        submit.textContent = "Replace";
        submit.focus();
      } else if (done) dialog.close();
    };
    dialog.showModal();
    name.focus();
    name.select();
  }

  /** @param {string} text */
  say(text, kind = "") {
    this.told = kind;
    for (const told of this.root.querySelectorAll(".program-told")) {
      told.textContent = text;
      told.dataset.kind = kind;
    }
  }

  /**
   * A call; its error is shown, and undefined comes back.
   * @template {keyof Calls} Name
   * @param {Name} name
   * @param {Parameters<Calls[Name]>} values
   * @returns {Promise<ReturnType<Calls[Name]> | undefined>}
   */
  async ask(name, ...values) {
    try {
      return await detent.call(name, ...values);
    } catch (error) {
      this.say(wordsOf(error), "bad");
      detent.failed(error);
      return undefined;
    }
  }
}

detent.part("program", (root) => {
  const program = new Program(root);
  root.program = program; // for tests and for the curious
  program.open();
  return () => program.close();
});
