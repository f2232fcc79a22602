// The page Begin: what can be opened, a new cell out of units and wires, the commands of a model.

const { part, call, toast, remembered, remember } = window.detent;

part("begin", (box) => {
  const role = (name) => box.querySelector(`[data-role="${name}"]`);
  let jacks = {};
  let fittings = { motors: [], axes: {}, programs: [] };
  let cell = { title: "", units: [], wires: [], switches: [], motors: [] };
  const open = new Set(); // units whose fittings are shown
  let from = null; // the output that was clicked
  let armed = "";
  try {
    cell = { ...cell, ...JSON.parse(remembered("newcell") || "{}") };
  } catch {
    /* begun anew */
  }

  function element(tag, name, text) {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function button(name, text, action, help) {
    const made = element("button", name, text);
    made.type = "button";
    if (help) made.dataset.help = help;
    made.addEventListener("click", action);
    return made;
  }

  // -- opening --

  async function openPlace(place) {
    toast("Opening\u2026");
    try {
      await call("open_place", place);
      location.href = "/";
    } catch (error) {
      toast(error.message, "error");
    }
  }

  async function places() {
    const told = await call("places").catch((error) => toast(error.message, "error"));
    if (!told) return;
    const group = (title, list, none) => {
      const made = element("div", "group");
      made.append(element("h3", "", title));
      for (const [place, words] of list) {
        const one = button("key place", "", () => openPlace(place));
        one.append(element("b", "", place.replace(/^example:/, "")), element("span", "quiet", words === place ? "" : words));
        if (place === told.open) one.append(element("span", "open", "open"));
        made.append(one);
      }
      if (!list.length) made.append(element("p", "quiet", none));
      return made;
    };
    role("places").replaceChildren(
      group(`Cells in ${told.folder}`, told.cells, "None yet: make one at the side, or start with --folder."),
      group("Models alone", told.models, ""),
      group("Examples", told.examples, "They are not installed here."),
    );
    const unit = element("a", "key place", "");
    unit.href = "/unit";
    unit.append(element("b", "", "A real unit"), element("span", "quiet", "at a port of this computer, or of another"));
    role("places").prepend(unit);
    find();
  }

  function find() {
    const words = role("find").value.toLowerCase();
    for (const one of box.querySelectorAll(".place")) one.hidden = !one.textContent.toLowerCase().includes(words);
  }
  role("find").addEventListener("input", find);

  // -- a new cell --

  const hint = (text) => (role("hint").textContent = text);

  function draw() {
    remember("newcell", JSON.stringify(cell));
    const wires = new Map();
    for (const { source, target } of cell.wires) wires.set(source, [...(wires.get(source) || []), target]);
    for (const one of cell.switches) wires.set(one.name, [one.drives].filter(Boolean));
    const board = element("div", "cell board");
    board.dataset.part = "wires";
    board.dataset.wires = JSON.stringify([...wires]);
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.classList.add("wires");
    svg.setAttribute("aria-hidden", "true");
    const cards = element("div", "units");
    board.append(svg, cards);
    for (const unit of cell.units) cards.append(card(unit));
    for (const one of cell.switches) cards.append(lever(one));
    role("board").replaceChildren(...(cell.units.length ? [board] : []), list());
    text();
  }

  function card(unit) {
    const made = element("section", "panel");
    const head = element("div", "panel-head");
    head.append(element("h3", "grow", unit.name), element("span", "quiet", unit.model), button("key small", "\u00d7", () => {
      const of = (end) => end.split(".")[0] === unit.name;
      cell.units = cell.units.filter((one) => one !== unit);
      cell.wires = cell.wires.filter((wire) => !of(wire.source) && !of(wire.target));
      cell.switches = cell.switches.filter((one) => !of(one.drives));
      cell.motors = cell.motors.filter((one) => one.unit !== unit.name);
      draw();
    }, `Take ${unit.name} away`));
    const pins = element("div", "jacks");
    for (const side of ["in", "out"]) {
      const column = element("div", side);
      for (const pin of (jacks[unit.model] || {})[side] || []) column.append(jack(`${unit.name}.${pin}`, pin, side));
      pins.append(column);
    }
    made.append(head, pins, fitted(unit));
    return made;
  }

  function field(label, made, changed) {
    const box = element("label", "quiet", `${label} `);
    made.className += " field";
    made.setAttribute("aria-label", label);
    made.addEventListener("change", () => {
      changed(made.value.trim());
      draw();
    });
    box.append(made);
    return box;
  }

  function choice(values, chosen) {
    const made = element("select", "");
    made.append(...values.map((value) => new Option(value || "\u2013", value)));
    made.value = chosen;
    return made;
  }

  function input(value, type = "text") {
    const made = element("input", "mono");
    made.type = type;
    if (type === "number") made.step = "any";
    made.value = value ?? "";
    return made;
  }

  /** What a unit has besides its wires: straps, a program, a motor on each axis. */
  function fitted(unit) {
    const box = element("details", "fitted");
    box.open = open.has(unit.name);
    box.addEventListener("toggle", () => (box.open ? open.add(unit.name) : open.delete(unit.name)));
    box.append(element("summary", "", "Straps, program, motor"));
    const straps = element("div", "row wrap");
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
      const row = element("div", "row wrap");
      row.append(field(`Motor ${axis}`.trim(), choice(["", ...fittings.motors], motor ? motor.motor : ""), (value) => {
        cell.motors = cell.motors.filter((one) => one !== motor);
        if (value) cell.motors.push({ supply: 24, lead: null, ...motor, unit: unit.name, axis, motor: value });
      }));
      if (motor) {
        row.append(field("Supply, V", input(motor.supply, "number"), (value) => (motor.supply = Number(value) || 24)));
        row.append(field("Lead, mm or \u00b0 a step", input(motor.lead, "number"), (value) => (motor.lead = Number(value) || null)));
      }
      box.append(row);
    }
    return box;
  }

  function jack(end, pin, side) {
    const used = cell.wires.some((wire) => wire.source === end || wire.target === end) || cell.switches.some((one) => one.drives === end);
    const made = button(`pin${used ? " wired" : ""}${from === end ? " lit" : ""}`, pin, () => click(end, side));
    made.dataset.jack = end;
    made.dataset.side = side === "in" ? "left" : "right";
    made.setAttribute("aria-label", `${side === "in" ? "Input" : "Output"} ${end}`);
    made.append(element("i", "jack"));
    return made;
  }

  function lever(one) {
    const made = element("section", "panel");
    const head = element("div", "panel-head");
    const out = jack(one.name, `switch ${one.name}`, "out");
    out.classList.add("wired");
    head.append(out, element("span", "grow"), button("key small", `begins at ${one.level}`, () => {
      one.level = one.level ? 0 : 1;
      draw();
    }), button("key small", "\u00d7", () => {
      cell.switches = cell.switches.filter((other) => other !== one);
      draw();
    }, `Take ${one.name} away`));
    made.append(head);
    return made;
  }

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
    const made = element("ul", "wirelist");
    for (const wire of cell.wires) {
      const one = element("li", "", "");
      one.append(element("span", "mono", `${wire.source} \u2192 ${wire.target} `), button("key small", "\u00d7", () => {
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
      words = error.message;
      bad = true;
    }
    if (mine !== JSON.stringify(cell)) return;
    role("text").textContent = words;
    role("text").classList.toggle("bad", bad);
  }

  const ready = () => ({ ...cell, switches: cell.switches.filter((one) => one.drives) });
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
      toast(/there already/.test(error.message) ? `${name} is there already. Click once more to replace it.` : error.message, "error");
      armed = /there already/.test(error.message) ? name : "";
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

  let rows = [];
  async function commands() {
    rows = await call("command_reference", role("model").value).catch(() => []);
    search();
  }
  function search() {
    const words = role("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = rows.filter((row) => words.every((word) => Object.values(row).join(" ").toLowerCase().includes(word)));
    role("commands").replaceChildren(...found.map((row) => {
      const made = element("tr", "");
      made.append(element("td", "mono", `${row.command} ${row.argument}`), element("td", "", row.what), element("td", "quiet", row.section));
      return made;
    }));
    if (!found.length) role("commands").append(element("tr", "quiet", "No command says that."));
  }
  role("model").addEventListener("change", commands);
  role("search").addEventListener("input", search);

  Promise.all([call("jacks"), call("fittings")]).then(([told, more]) => {
    jacks = told;
    fittings = more;
    role("unit-model").replaceChildren(...Object.keys(jacks).map((name) => new Option(name, name)));
    draw();
  }).catch((error) => toast(error.message, "error"));
  places();
  commands();
});
