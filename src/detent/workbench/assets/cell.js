// The moving parts of the page Cell: dials, slides with their switches, inputs under a hand, command lines.

import { pitch } from "./forms.js";

const { part, on, get, action, meant, underWay, make, call, toast, failed, onTheme, theme, grouped } = window.detent;

// -- dials ----------------------------------------------------------------------------------------------

part("dial", (svg) => {
  const turn = Number(svg.dataset.turn);
  const hands = [[svg.querySelector(".pointer"), svg.dataset.key], [svg.querySelector(".command"), svg.dataset.command]];
  const ends = hands
    .filter(([hand, key]) => hand && key)
    .map(([hand, key]) => on(key, (changed, value) => {
      if (changed === key && value !== null) hand.setAttribute("transform", `rotate(${(((value % turn) / turn) * 360).toFixed(2)})`);
    }));
  return () => ends.forEach((end) => end());
});

// -- slides ---------------------------------------------------------------------------------------------

const AIR = 12; // px beside the scale

part("slide", (box) => {
  const facts = JSON.parse(box.dataset.facts);
  const canvas = document.createElement("canvas");
  const carriage = document.createElement("div");
  carriage.className = "carriage";
  box.append(canvas, carriage);
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const flags = new Map();
  let place = 0;
  let low = -20;
  let high = 100;
  let planned = 0;
  let drawn = ""; // the scale that is on the page
  /** @type {[string, number | null, number | null] | null} the switch under a hand: name, low, high */
  let held = null;

  const width = () => Math.max(1, box.clientWidth - 2 * AIR);
  /** @param {number} at */
  const x = (at) => AIR + ((at - low) / (high - low)) * width();
  /** @param {number} px */
  const at = (px) => low + ((px - AIR) / width()) * (high - low);
  /** @param {string} name */
  const range = (name) => (held && held[0] === name ? held.slice(1) : [get(`s.${name}.low`), get(`s.${name}.high`)]);

  /** The scale grows so that everything is on it, in steps that the eye can follow; it never shrinks. */
  function fit() {
    const seen = [place, 0];
    for (const name of facts.switches) for (const end of range(name)) if (typeof end === "number") seen.push(end);
    const least = Math.min(...seen);
    const most = Math.max(...seen);
    if (least >= low && most <= high) return;
    const span = Math.max(most, high) - Math.min(least, low);
    const grid = pitch(span, 8);
    if (least < low) low = Math.floor((least - span * 0.08) / grid) * grid;
    if (most > high) high = Math.ceil((most + span * 0.08) / grid) * grid;
  }

  function draw() {
    planned = 0;
    fit();
    carriage.style.transform = `translateX(${x(place).toFixed(1)}px)`;
    const scale = [low, high, box.clientWidth, theme(), held, ...facts.switches.map(range)].join();
    if (scale === drawn) return;
    drawn = scale;
    const ratio = window.devicePixelRatio || 1;
    const wide = box.clientWidth;
    const tall = box.clientHeight;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(tall * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(tall * ratio);
    }
    const css = getComputedStyle(box);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, tall);
    pen.fillStyle = css.getPropertyValue("--line");
    pen.fillRect(AIR, 16, width(), 3);
    const every = pitch(high - low, Math.max(2, wide / 64));
    pen.font = `11px ${css.getPropertyValue("--mono")}`;
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (let tick = Math.ceil(low / every - 1e-9) * every; tick <= high + every * 1e-9; tick += every) {
      const px = Math.round(x(tick));
      pen.fillStyle = css.getPropertyValue("--line-2");
      pen.fillRect(px, 27, 1, 6);
      pen.fillStyle = css.getPropertyValue("--ink-2");
      const text = Number.isInteger(every) ? grouped(Math.round(tick)) : String(Number(tick.toPrecision(6)));
      const half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.max(half, Math.min(px, wide - half)), 35);
    }
    for (const name of facts.switches) {
      const flag = flags.get(name);
      const [from, to] = range(name);
      const left = from === null || from === undefined ? AIR : x(from);
      const right = to === null || to === undefined ? AIR + width() : x(to);
      flag.style.left = `${left - (right - left < 12 ? 6 : 0)}px`;
      flag.style.width = `${Math.max(12, right - left)}px`;
      flag.classList.toggle("open-low", from === null);
      flag.classList.toggle("open-high", to === null);
      const told = `${from === null ? "\u2026" : round(from)} to ${to === null ? "\u2026" : round(to)}`;
      flag.setAttribute("aria-valuetext", told);
      flag.setAttribute("aria-valuenow", String(from === null ? to : from));
      const places = box.parentElement.querySelector(`[data-places="${CSS.escape(name)}"]`);
      if (places && places.textContent !== told) places.textContent = told;
    }
  }

  /** @param {number} value */
  const round = (value) => (facts.whole ? Math.round(value) : Number(value.toFixed(3)));

  function plan() {
    if (!planned) planned = requestAnimationFrame(draw);
  }

  /**
   * @param {string} name
   * @param {number} by
   * @returns {[number | null, number | null]}
   */
  function moved(name, by) {
    const [from, to] = [meant(`s.${name}.low`), meant(`s.${name}.high`)];
    return [from === null ? null : round(from + by), to === null ? null : round(to + by)];
  }

  /**
   * @param {string} name
   * @param {number | null} from
   * @param {number | null} to
   */
  const put = (name, from, to) =>
    make(`s.${name}.low`, from, () => make(`s.${name}.high`, to, () => action("place_switch", name, from, to)));

  for (const name of facts.switches) {
    const flag = document.createElement("button");
    flag.className = "flag";
    flag.setAttribute("role", "slider");
    flag.setAttribute("aria-label", `Place of switch ${name}`);
    flag.dataset.help = `Switch ${name}: drag it along the axis`;
    flag.dataset.flag = name;
    flags.set(name, flag);
    box.append(flag);
    let grabbed = 0;
    flag.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      flag.focus({ preventScroll: true });
      flag.setPointerCapture(event.pointerId);
      grabbed = at(event.clientX - box.getBoundingClientRect().left);
      held = [name, meant(`s.${name}.low`), meant(`s.${name}.high`)];
    });
    flag.addEventListener("pointermove", (event) => {
      if (!held || held[0] !== name) return;
      const px = Math.max(AIR, Math.min(box.clientWidth - AIR, event.clientX - box.getBoundingClientRect().left));
      held = [name, ...moved(name, at(px) - grabbed)];
      plan();
    });
    const drop = async () => {
      if (!held || held[0] !== name) return;
      const mine = held;
      if (mine[1] !== meant(`s.${name}.low`) || mine[2] !== meant(`s.${name}.high`)) await put(...mine);
      if (held === mine) held = null; // else it is under a hand again
      plan();
    };
    flag.addEventListener("pointerup", drop);
    flag.addEventListener("pointercancel", () => {
      held = null;
      plan();
    });
    flag.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10 }[event.key];
      if (!by) return;
      event.preventDefault();
      put(name, ...moved(name, by * (facts.whole ? 1 : (high - low) / 1000)));
    });
  }

  const ends = [
    on(facts.key, (key, value) => {
      if (key !== facts.key || value === null) return;
      place = value * facts.lead;
      plan();
    }),
    ...facts.switches.map((/** @type {string} */ name) => on(`s.${name}.`, plan)),
    onTheme(plan),
  ];
  const resized = new ResizeObserver(plan);
  resized.observe(box);
  return () => {
    ends.forEach((end) => end());
    resized.disconnect();
  };
});

// -- inputs, addresses, command lines -------------------------------------------------------------------

part("input-pin", (button) => {
  const { unit, pin } = button.dataset;
  const key = `u.${unit}.hand`;
  const mine = `${key}.${pin}`;
  const held = () => (get(key) || []).includes(pin);
  let other = 0; // the level that a hand gives it
  button.addEventListener("click", () => {
    if (!underWay(mine) && !held()) other = get(`u.${unit}.pin.${pin}`) ? 0 : 1;
    const hold = !meant(mine, held());
    make(mine, hold, () => action("set_pin", unit, pin, hold ? other : null));
  });
  return on(key, (changed) => {
    if (changed !== key) return;
    button.classList.toggle("held", held());
    button.setAttribute("aria-pressed", held() ? "true" : "false");
  });
});

part("registers", (list) => {
  const shown = new Map(); // name -> its value on the page
  const { key } = list.dataset;
  return on(key, (changed, value) => {
    if (changed !== key) return;
    for (const name of shown.keys()) {
      if (!(name in value)) {
        shown.get(name).parentElement.remove();
        shown.delete(name);
      }
    }
    for (const [name, text] of Object.entries(value)) {
      if (!shown.has(name)) {
        const row = document.createElement("div");
        row.append(document.createElement("dt"), document.createElement("dd"));
        row.children[0].textContent = name;
        list.append(row);
        shown.set(name, row.children[1]);
      }
      shown.get(name).textContent = text;
    }
  });
});

part("copy", (button) => {
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(button.dataset.copy);
      toast(`Copied: ${button.dataset.copy}`);
    } catch {
      toast(button.dataset.copy);
    }
  });
});

part("command", (form) => {
  const field = form.querySelector("input");
  /** @type {string[]} */
  const past = [];
  let shown = 0;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const text = field.value;
    if (!text) return;
    past.push(text);
    shown = past.length;
    field.value = ""; // at once: what is typed next is the next command
    try {
      await call("type", form.dataset.unit, text);
    } catch (error) {
      failed(error);
      if (!field.value) field.value = text; // to be mended
    }
  });
  field.addEventListener("keydown", (event) => {
    const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!by || !past.length) return;
    event.preventDefault();
    shown = Math.max(0, Math.min(past.length, shown + by));
    field.value = past[shown] || "";
  });
});
