// The page Begin: what can be opened, a new cell out of units and wires, the commands of a model.

import { worded } from "./elements.js";
import { wordsOf } from "./forms.js";

const { part, call, toast, failed, remembered, remember } = window.detent;

const AGAIN = 2000; // ms
const ARMED = 9000; // ms in which a second click is a yes: as long as the question is seen

part("begin", (box) => {
  /** @param {string} name */
  const role = (name) => box.querySelector(`[data-role="${name}"]`);
  /** @type {Record<string, Record<string, string[]>>} model -> the pins of each side, and its straps */
  let jacks = {};
  /** @type {{motors: string[], supplies: Record<string, number>, direct: Record<string, number>, uncontrolled: string[],
   *   axes: Record<string, string[]>, programs: string[]}} what can be fitted to a model */
  let fittings = { motors: [], supplies: {}, direct: {}, uncontrolled: [], axes: {}, programs: [] };
  /** @type {{title: string, units: any[], wires: {source: string, target: string}[], switches: any[], motors: any[]}} */
  let cell = { title: "", units: [], wires: [], switches: [], motors: [] };
  /** @type {Set<string>} */
  const open = new Set(); // units whose fittings are shown
  /** @type {string | null} the output that was clicked */
  let from = null;
  let armed = "";
  try {
    cell = { ...cell, ...JSON.parse(remembered("newcell") || "{}") };
  } catch {
    /* begun anew */
  }

  /**
   * @param {string} name
   * @param {string} text
   * @param {() => void} action
   * @param {string} [help]
   */
  function button(name, text, action, help) {
    const made = worded("button", name, text);
    made.type = "button";
    if (help) made.dataset.help = help;
    if (help && !/[a-z]/i.test(text)) made.setAttribute("aria-label", help); // a sign is no name
    made.addEventListener("click", action);
    return made;
  }

  // -- opening --

  /** @param {string} place */
  async function openPlace(place) {
    toast("Opening\u2026");
    try {
      await call("open_place", place);
      location.href = "/";
    } catch (error) {
      failed(error);
    }
  }

  async function places() {
    const told = await call("places").catch(failed);
    if (!told) return;
    /**
     * @param {string} title
     * @param {[string, string][]} list
     * @param {string} none
     */
    const group = (title, list, none) => {
      const made = worded("div", "group");
      made.append(worded("h3", "", title));
      for (const [place, words] of list) {
        const one = button("key place", "", () => openPlace(place));
        one.append(worded("b", "", place.replace(/^example:/, "")), worded("span", "quiet", words === place ? "" : words));
        if (place === told.open) one.append(worded("span", "open", "open"));
        made.append(one);
      }
      if (!list.length) made.append(worded("p", "quiet", none));
      return made;
    };
    role("places").replaceChildren(
      group(`Cells in ${told.folder}`, told.cells, "None yet: make one at the side, or start with --folder."),
      group("Models alone", told.models, ""),
      group("Examples", told.examples, "They are not installed here."),
    );
    const unit = worded("a", "key place", "");
    unit.href = "/unit";
    unit.append(worded("b", "", "A real unit"), worded("span", "quiet", "at a port of this computer, or of another"));
    role("places").prepend(unit);
    find();
  }

  function find() {
    const words = role("find").value.toLowerCase();
    for (const one of box.querySelectorAll(".place")) one.hidden = !one.textContent.toLowerCase().includes(words);
  }
  role("find").addEventListener("input", find);

  // -- a new cell --

  /** @param {string} text */
  const hint = (text) => (role("hint").textContent = text);

  function draw() {
    armed = ""; // what was asked about is another cell
    remember("newcell", JSON.stringify(cell));
    const wires = new Map();
    for (const { source, target } of cell.wires) wires.set(source, [...(wires.get(source) || []), target]);
    for (const one of cell.switches) wires.set(one.name, [one.drives].filter(Boolean));
    const board = worded("div", "cell board");
    board.dataset.part = "wires";
    board.dataset.wires = JSON.stringify([...wires]);
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.classList.add("wires");
    svg.setAttribute("aria-hidden", "true");
    const cards = worded("div", "units");
    board.append(svg, cards);
    for (const unit of cell.units) cards.append(card(unit));
    for (const one of cell.switches) cards.append(lever(one));
    role("board").replaceChildren(...(cell.units.length ? [board] : []), list());
    text();
  }

  /** @param {any} unit */
  function card(unit) {
    const made = worded("section", "panel");
    const head = worded("div", "panel-head");
    head.append(worded("h3", "grow", unit.name), worded("span", "quiet", unit.model), button("key small", "\u00d7", () => {
      /** @param {string} end */
      const of = (end) => end.split(".")[0] === unit.name;
      cell.units = cell.units.filter((one) => one !== unit);
      cell.wires = cell.wires.filter((wire) => !of(wire.source) && !of(wire.target));
      cell.switches = cell.switches.filter((one) => !of(one.drives));
      cell.motors = cell.motors.filter((one) => one.unit !== unit.name);
      draw();
    }, `Take ${unit.name} away`));
    const pins = worded("div", "jacks");
    for (const side of ["in", "out"]) {
      const column = worded("div", side);
      for (const pin of (jacks[unit.model] || {})[side] || []) column.append(jack(`${unit.name}.${pin}`, pin, side));
      pins.append(column);
    }
    made.append(head, pins, fitted(unit));
    return made;
  }

  /**
   * @param {string} label
   * @param {HTMLInputElement | HTMLSelectElement} made
   * @param {(value: string) => void} changed
   */
  function field(label, made, changed) {
    const box = worded("label", "quiet", `${label} `);
    made.className += " field";
    made.setAttribute("aria-label", label);
    made.addEventListener("change", () => {
      changed(made.value.trim());
      draw();
    });
    box.append(made);
    return box;
  }

  /**
   * @param {string[]} values
   * @param {string} chosen
   */
  function choice(values, chosen) {
    const made = worded("select", "");
    made.append(...values.map((value) => new Option(value || "\u2013", value)));
    made.value = chosen;
    return made;
  }

  /** @param {any} value */
  function input(value, type = "text") {
    const made = worded("input", "mono");
    made.type = type;
    if (type === "number") made.step = "any";
    made.value = value ?? "";
    return made;
  }

  /**
   * What a unit has besides its wires: straps, a program, a motor on each axis.
   * @param {any} unit
   */
  function fitted(unit) {
    const box = worded("details", "fitted");
    box.open = open.has(unit.name);
    box.addEventListener("toggle", () => (box.open ? open.add(unit.name) : open.delete(unit.name)));
    box.append(worded("summary", "", "Straps, program, motor"));
    const straps = worded("div", "row wrap");
    unit.straps ||= {};
    for (const pin of (jacks[unit.model] || {}).straps || [])
      straps.append(field(pin, choice(["", "low", "high"], unit.straps[pin] || ""), (value) => {
        if (value) unit.straps[pin] = value;
        else delete unit.straps[pin];
      }));
    box.append(straps);
    if (fittings.programs.includes(unit.model)) box.append(field("Program (a file beside the cell)", input(unit.program), (value) => (unit.program = value)));
    for (const axis of fittings.axes[unit.model] || []) {
      const motor = cell.motors.find((one) => one.unit === unit.name && one.axis === axis);
      const row = worded("div", "row wrap");
      row.append(field(`Motor ${axis}`.trim(), choice(["", ...fittings.motors], motor ? motor.motor : ""), (value) => {
        cell.motors = cell.motors.filter((one) => one !== motor);
        /** @param {string} name */
        const usual = (name) => fittings[fittings.uncontrolled.includes(unit.model) ? "direct" : "supplies"][name];
        const supply = motor && motor.supply !== usual(motor.motor) ? motor.supply : usual(value);
        if (value) cell.motors.push({ lead: null, ...motor, supply, unit: unit.name, axis, motor: value });
      }));
      if (motor) {
        row.append(field("Supply, V", input(motor.supply, "number"), (value) => (motor.supply = Number(value) || motor.supply)));
        row.append(field("Lead, mm or \u00b0 a step", input(motor.lead, "number"), (value) => (motor.lead = Number(value) || null)));
      }
      box.append(row);
    }
    return box;
  }

  /**
   * @param {string} end
   * @param {string} pin
   * @param {string} side
   */
  function jack(end, pin, side) {
    const used = cell.wires.some((wire) => wire.source === end || wire.target === end) || cell.switches.some((one) => one.drives === end);
    const made = button(`pin${used ? " wired" : ""}${from === end ? " lit" : ""}`, pin, () => click(end, side));
    made.dataset.jack = end;
    made.dataset.side = side === "in" ? "left" : "right";
    made.setAttribute("aria-label", `${side === "in" ? "Input" : "Output"} ${end}`);
    made.append(worded("i", "jack"));
    return made;
  }

  /** @param {any} one */
  function lever(one) {
    const made = worded("section", "panel");
    const head = worded("div", "panel-head");
    const out = jack(one.name, `switch ${one.name}`, "out");
    out.classList.add("wired");
    head.append(out, worded("span", "grow"), button("key small", `begins at ${one.level}`, () => {
      one.level = one.level ? 0 : 1;
      draw();
    }), button("key small", "\u00d7", () => {
      cell.switches = cell.switches.filter((other) => other !== one);
      draw();
    }, `Take ${one.name} away`));
    made.append(head);
    return made;
  }

  /**
   * @param {string} end
   * @param {string} side
   */
  function click(end, side) {
    if (side === "out") {
      from = from === end ? null : end;
      hint(from ? `${from} leads to \u2026 click an input.` : "Click an output, and the input that it leads to.");
    } else if (from === null) {
      hint(`Click the output that leads to ${end} first.`);
      return;
    } else {
      const lead = cell.switches.find((one) => one.name === from);
      if (lead) lead.drives = end;
      else if (!cell.wires.some((wire) => wire.source === from && wire.target === end)) cell.wires.push({ source: from, target: end });
      hint(`${from} leads to ${end}.`);
      from = null;
    }
    draw();
  }

  function list() {
    const made = worded("ul", "wirelist");
    for (const wire of cell.wires) {
      const one = worded("li", "", "");
      one.append(worded("span", "mono", `${wire.source} \u2192 ${wire.target} `), button("key small", "\u00d7", () => {
        cell.wires = cell.wires.filter((other) => other !== wire);
        draw();
      }, "Take this wire away"));
      made.append(one);
    }
    return made;
  }

  async function text() {
    const mine = JSON.stringify(cell);
    role("text").classList.remove("bad");
    if (!cell.units.length) {
      role("text").textContent = "";
      return;
    }
    let words = "";
    let bad = false;
    try {
      words = await call("new_cell", ready(), role("file").value.trim());
    } catch (error) {
      words = wordsOf(error);
      bad = true;
    }
    if (mine !== JSON.stringify(cell)) return;
    role("text").textContent = words;
    role("text").classList.toggle("bad", bad);
  }

  const ready = () => ({ ...cell, switches: cell.switches.filter((one) => one.drives) });
  /**
   * @param {string} base
   * @param {string[]} taken
   */
  const free = (base, taken) => {
    let name = base;
    for (let n = 2; taken.includes(name); n += 1) name = `${base}${n}`;
    return name;
  };

  role("add-unit").addEventListener("click", () => {
    const name = role("unit-name").value.trim() || free("unit", cell.units.map((one) => one.name));
    if (cell.units.some((one) => one.name === name)) {
      toast(`There is a unit ${name} already: give this one another name.`, "error");
      return;
    }
    cell.units.push({ name, model: role("unit-model").value });
    role("unit-name").value = "";
    draw();
  });
  role("add-switch").addEventListener("click", () => {
    const name = free("start", [...cell.switches, ...cell.units].map((one) => one.name));
    cell.switches.push({ name, drives: "", level: 0 });
    from = name;
    hint(`${name} leads to \u2026 click an input.`);
    draw();
  });

  async function save() {
    const name = role("file").value.trim();
    if (!name) {
      toast("Give the file a name first.", "error");
      role("file").focus();
      return "";
    }
    try {
      const told = await call("save_cell", name, ready(), armed === name);
      armed = "";
      toast(`Saved: ${told}`);
      places();
      return told;
    } catch (error) {
      toast(/there already/.test(wordsOf(error)) ? `${name} is there already. Click once more to replace it.` : wordsOf(error), "error");
      armed = /there already/.test(wordsOf(error)) ? name : "";
      setTimeout(() => (armed = ""), ARMED);
      return "";
    }
  }
  role("save").addEventListener("click", save);
  role("save-open").addEventListener("click", async () => {
    const name = await save();
    if (name) openPlace(name);
  });
  role("file").addEventListener("input", () => (armed = ""));

  // -- commands --

  /** @type {Command[]} */
  let rows = [];
  async function commands() {
    rows = await call("command_reference", role("model").value).catch(() => []);
    search();
  }
  function search() {
    const words = role("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = rows.filter((row) => words.every((/** @type {string} */ word) => Object.values(row).join(" ").toLowerCase().includes(word)));
    role("commands").replaceChildren(...found.map((row) => {
      const made = worded("tr", "");
      made.append(worded("td", "mono", `${row.command} ${row.argument}`), worded("td", "", row.what), worded("td", "quiet", row.section));
      return made;
    }));
    if (!found.length) role("commands").append(worded("tr", "quiet", "No command says that."));
  }
  role("model").addEventListener("change", commands);
  role("search").addEventListener("input", search);

  /** What a new cell is made of: asked for again until there is a connection, however slow it is in coming. */
  const load = () => Promise.all([call("jacks"), call("fittings")]).then(([told, more]) => {
    jacks = told;
    fittings = more;
    role("unit-model").replaceChildren(...Object.keys(jacks).map((name) => new Option(name, name)));
    draw();
  }).catch((error) => {
    failed(error);
    if (box.isConnected) setTimeout(load, AGAIN);
  });
  load();
  places();
  commands();
});
