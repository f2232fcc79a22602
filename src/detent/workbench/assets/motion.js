/* The Motion page: sliders, the picture of the move, the motor's torque. Every number comes from the server
   (detent/workbench/moves.py); nothing is sent to the unit but by its keys. */

import { Chart } from "./chart.js";
import { element } from "./scope_tools.js";
import { showNumber, showSpan } from "./scope_plot.js";

const MOVE_AFTER = 25,
  JUDGE_AFTER = 180; // ms behind the last change
const NOTCHES = 1000; // of a slider
const WIDE = 50; // from so many times the least on, a slider counts in proportions

class Motion {
  constructor(root) {
    this.root = root;
    this.find = (selector) => root.querySelector(selector);
    this.charts = Object.fromEntries(
      ["speed", "place", "torque"].map((name) => [name, new Chart(this.find(`.motion-chart.${name} canvas`))]),
    );
    this.form = this.find(".motion-form");
    this.number = 0;
    for (const tab of root.querySelectorAll("[data-unit]")) tab.addEventListener("click", () => this.show(tab));
    for (const key of root.querySelectorAll("[data-key]"))
      key.addEventListener("click", () => this.actions[key.dataset.key]());
    this.form.addEventListener("input", (event) => this.formChanged(event.target.name));
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.unTheme = detent.onTheme(() => Object.values(this.charts).forEach((chart) => chart.paint()));
    const tabs = [...root.querySelectorAll("[data-unit]")],
      last = detent.remembered("motion.axis");
    const first = tabs.find((tab) => `${tab.dataset.unit}.${tab.dataset.axis}` === last) || tabs[0];
    if (first) this.show(first);
  }

  close() {
    this.closed = true;
    for (const chart of Object.values(this.charts)) chart.close();
    if (typeof this.unTheme === "function") this.unTheme();
  }

  async show(tab) {
    const { unit, axis } = tab.dataset,
      about = await this.ask("motion_about", unit, axis);
    if (!about || this.closed) return;
    this.about = about;
    detent.remember("motion.axis", `${unit}.${axis}`);
    for (const other of this.root.querySelectorAll("[data-unit]")) other.setAttribute("aria-selected", other === tab);
    this.find(".motion-law").textContent = about.law;
    this.values = { ...about.values };
    this.steps = about.steps;
    this.sliders();
    this.fillForm();
    this.changed();
  }

  /* -- sliders ------------------------------------------------------------------------------------------------ */

  sliders() {
    const { settings, most, units } = this.about;
    const rows = [
      ...settings.map((setting) => ({
        ...setting,
        get: () => this.values[setting.name],
        set: (value) => {
          this.values[setting.name] = value;
        },
      })),
      {
        name: "steps",
        title: "move length",
        unit: units,
        low: 1,
        high: most,
        scale: 1,
        get: () => this.steps,
        set: (value) => {
          this.steps = value;
        },
      },
    ];
    this.rows = rows.map((row) => this.slider(row));
    this.find(".motion-sliders").replaceChildren(...this.rows.map((row) => row.place));
  }

  slider(row) {
    const wide = row.high / Math.max(row.low, 1) > WIDE,
      shift = row.low < 1 ? 1 : 0;
    const notch = (value) =>
      wide
        ? (NOTCHES * Math.log((value + shift) / (row.low + shift))) / Math.log((row.high + shift) / (row.low + shift))
        : (NOTCHES * (value - row.low)) / Math.max(row.high - row.low, 1);
    const value = (at) => {
      const exact = wide
        ? (row.low + shift) * ((row.high + shift) / (row.low + shift)) ** (at / NOTCHES) - shift
        : row.low + (at / NOTCHES) * (row.high - row.low);
      const size = wide ? 10 ** Math.max(Math.floor(Math.log10(Math.max(exact, 1))) - 1, 0) : 1; // two figures will do
      return Math.min(Math.max(Math.round(exact / size) * size, row.low), row.high);
    };
    const range = element("input", {
      type: "range",
      min: 0,
      max: NOTCHES,
      step: 1,
      "aria-label": row.title,
      "data-setting": row.name,
    });
    const exact = element("input", {
      type: "number",
      class: "field mono",
      min: row.low * row.scale,
      max: row.high * row.scale,
      step: row.scale,
      "aria-label": `${row.title}, ${row.unit}`,
      "data-exact": row.name,
    });
    const limit = element("small", { class: "motion-limit", role: "status" });
    const show = () => {
      limit.textContent = "";
      range.value = notch(row.get());
      if (document.activeElement !== exact) exact.value = row.get() * row.scale;
      range.setAttribute("aria-valuetext", `${row.get() * row.scale} ${row.unit}`);
    };
    range.addEventListener("input", () => {
      limit.textContent = "";
      row.set(value(Number(range.value)));
      exact.value = row.get() * row.scale;
      this.changed();
    });
    range.addEventListener("keydown", (event) => {
      // one count at a time
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!by) return;
      event.preventDefault();
      row.set(Math.min(Math.max(row.get() + by, row.low), row.high));
      show();
      this.changed();
    });
    exact.addEventListener("input", () => {
      const wanted = Math.round(Number(exact.value) / row.scale);
      if (!exact.value || !Number.isFinite(wanted)) return;
      row.set(Math.min(Math.max(wanted, row.low), row.high));
      limit.textContent =
        row.get() === wanted
          ? ""
          : `takes ${row.low * row.scale} to ${row.high * row.scale} ${row.unit}: ${row.get() * row.scale} is meant`;
      range.value = notch(row.get());
      this.changed();
    });
    exact.addEventListener("change", () => {
      exact.value = row.get() * row.scale;
    });
    const place = element(
      "div",
      { class: "motion-slider" },
      element(
        "span",
        { class: "motion-name" },
        element("b", { class: "mono" }, row.name === "steps" ? "" : row.name.split(" ")[0]),
        ` ${row.title}`,
      ),
      element("span", { class: "motion-exact" }, exact, element("small", {}, row.unit)),
      range,
      limit,
    );
    show();
    return { ...row, place, show };
  }

  /* -- the picture ---------------------------------------------------------------------------------------------- */

  get wanted() {
    return { unit: this.about.unit, axis: this.about.axis, values: this.values, steps: this.steps };
  }

  changed() {
    clearTimeout(this.moveSoon);
    this.moveSoon = setTimeout(() => this.draw(), MOVE_AFTER);
    this.judgeLater();
  }

  async draw() {
    const number = ++this.number,
      move = await this.ask("motion_move", this.wanted);
    if (!move || this.closed || number !== this.number) return;
    this.move = move;
    const { units } = this.about,
      seconds = move.duration * 1e-9,
      small = seconds < 0.5,
      unit = small ? "ms" : "s",
      scale = small ? 1e3 : 1;
    const over = (values) => move.times.map((t, i) => [t * scale, values[i]]);
    const speeds = [[0, 0], ...over(move.speeds), [seconds * scale, 0]];
    const right = seconds * scale * 1.02;
    this.charts.speed.draw({
      right,
      top: move.peak * 1.12,
      x: unit,
      y: `${units}/s`,
      lines: [{ points: speeds, colour: "--trace-1", fill: true }],
    });
    this.charts.place.draw({
      right,
      top: move.steps * 1.08,
      x: unit,
      y: units,
      lines: [{ points: over(move.positions), colour: "--trace-2" }],
    });
    const facts = {
      duration: showSpan(move.duration),
      peak: `${showNumber(+move.peak.toPrecision(6))} ${units}/s`,
      mean: `${showNumber(+move.mean.toPrecision(5))} ${units}/s`,
      up: showSpan(move.up * 1e9),
      down: showSpan(move.down * 1e9),
    };
    for (const [name, text] of Object.entries(facts)) this.find(`[data-fact=${name}]`).textContent = text;
    this.find("[data-fact=peak]").title = move.reached ? "" : "the move is too short for the slew speed";
    this.find("[data-fact=peak]").classList.toggle("short", !move.reached);
    this.find(".motion-lines").replaceChildren(...[...move.settings, move.go].map((line) => element("span", {}, line)));
    this.find("[data-key=send]").disabled = !move.settings.length;
    this.root.dataset.drawn = number;
  }

  /* -- the motor --------------------------------------------------------------------------------------------------- */

  fillForm() {
    const { motors, fitted, steppings } = this.about,
      { motor, stepping } = this.form.elements;
    motor.replaceChildren(
      ...(fitted
        ? [element("option", { value: "fitted" }, `${fitted.name} (${fitted.motor}, in the cell)`)]
        : [element("option", { value: "" }, "none")]),
      ...motors.map(({ name, title }) => element("option", { value: name, title }, name)),
    );
    stepping.replaceChildren(...steppings.map((name) => element("option", { value: name }, name)));
    const kept = detent.remembered("motion.motor") || "";
    motor.value = fitted ? "fitted" : motors.some(({ name }) => name === kept) ? kept : "";
    this.takeMotor();
  }

  takeMotor() {
    const { motor, stepping, supply, current, inertia, friction, damping } = this.form.elements,
      { fitted, motors } = this.about;
    const found = motor.value === "fitted" ? fitted : motors.find(({ name }) => name === motor.value);
    for (const field of [stepping, supply, current, inertia, friction, damping]) field.disabled = !found;
    if (!found) return;
    stepping.value = found.stepping || this.about.stepping;
    supply.value = found.supply;
    current.value = found.current;
    inertia.value = +found.inertia.toPrecision(4);
    friction.value = found.friction || 0;
    damping.value = found.damping;
  }

  formChanged(name) {
    if (name === "motor") {
      detent.remember("motion.motor", this.form.elements.motor.value);
      this.takeMotor();
    }
    this.judgeLater();
  }

  judgeLater() {
    clearTimeout(this.judgeSoon);
    const { motor } = this.form.elements;
    if (!motor.value) {
      this.verdict("", "");
      this.find(".motion-words").textContent = "";
      this.charts.torque.draw({ note: "Choose a motor for its torque and a verdict." });
      return;
    }
    this.judgeSoon = setTimeout(() => this.judge(), JUDGE_AFTER);
  }

  async judge() {
    if (this.judging) {
      this.again = true;
      return;
    }
    const { motor, stepping, supply, current, inertia, friction, damping } = this.form.elements,
      { fitted, units } = this.about;
    const numbers = Object.fromEntries(
      Object.entries({ supply, current, inertia, friction, damping }).map(([name, field]) => [name, Number(field.value)]),
    );
    this.judging = true;
    if (!this.charts.torque.what || this.charts.torque.what.note) this.charts.torque.draw({ note: "Computing \u2026" });
    this.root.toggleAttribute("data-judging", true);
    let found = null,
      words = "";
    try {
      found = await detent.call("motion_motor", this.wanted, {
        motor: motor.value === "fitted" ? fitted.motor : motor.value,
        stepping: stepping.value,
        ...numbers,
      });
    } catch (error) {
      words = error.message;
    }
    this.judging = false;
    if (this.closed) return;
    if (this.again) {
      this.again = false;
      this.judge();
      return;
    }
    this.root.toggleAttribute("data-judging", false);
    this.find(".motion-words").textContent = found ? found.words : words;
    if (!found) {
      this.verdict("", "");
      this.charts.torque.draw({ note: "This motor cannot be judged so." });
      return;
    }
    const curve = found.curve.map(([speed, torque]) => [speed, Math.max(torque, 0)]);
    const top = 1.15 * Math.max(...curve.map(([, torque]) => torque), ...found.asked.map(([, torque]) => torque));
    const right = Math.max(curve.at(-1)[0], found.asked.at(-1)[0] * 1.1);
    this.charts.torque.draw({
      right,
      top,
      x: `${units}/s`,
      y: "Nm",
      lines: [
        { points: [[0, curve[0][1]], ...curve], colour: "--trace-3", fill: true, label: "the motor gives" },
        { points: found.asked, colour: "--trace-2", width: 2.5, label: "the move asks", end: true },
      ],
    });
    const { verdict } = found;
    if (!verdict) this.verdict("", "");
    else if (verdict.lost) this.verdict("steps lost", "bad");
    else if (verdict.often) this.verdict(`no step lost, but by ${verdict.often} of ${verdict.of} variants`, "bad");
    else if (verdict.of) this.verdict(`no step lost, by none of ${verdict.of} variants`, "good");
    else this.verdict("no step lost", "good");
  }

  verdict(text, kind) {
    const place = this.find(".motion-verdict");
    place.textContent = text;
    place.dataset.kind = kind;
  }

  /* -- keys ---------------------------------------------------------------------------------------------------- */

  get actions() {
    const tell = (text) => {
      this.find(".motion-told").textContent = text;
    };
    const send = async (lines) => {
      for (const line of lines) if ((await this.ask("type", this.about.unit, line)) === undefined) return;
      tell(`sent: ${lines.join(", ")}; the answers are on the Terminal page`);
    };
    return {
      send: () => send(this.move.settings),
      move: () => send([...this.move.settings, this.move.go]),
      now: async () => {
        const about = await this.ask("motion_about", this.about.unit, this.about.axis);
        if (!about) return;
        this.values = { ...about.values };
        for (const row of this.rows) row.show();
        this.changed();
      },
    };
  }

  async ask(name, ...values) {
    try {
      return await detent.call(name, ...values);
    } catch (error) {
      detent.toast(error.message, "error");
      return undefined;
    }
  }
}

detent.part("motion", (root) => {
  const motion = new Motion(root);
  root.motion = motion; // for tests and for the curious
  return () => motion.close();
});
