/* The Motion page: sliders, the picture of the move, A beside it, the motor's torque and its verdict. Every number comes
   from the server (detent/workbench/moves.py); nothing is sent to the unit but by its keys. */

import { Chart } from "./chart.js";
import { exported } from "./motion_export.js";
import { MotorForm } from "./motion_form.js";
import { Sending } from "./motion_sending.js";
import { sliders } from "./motion_sliders.js";
import { Tuning } from "./motion_tuning.js";
import { element } from "./elements.js";
import { wordsOf } from "./forms.js";
import { showNumber, showSpan } from "./scope_plot.js";

const MOVE_AFTER = 25,
  JUDGE_AFTER = 180; // ms behind the last change
const CHARTS = ["speed", "acceleration", "place", "torque"];

export class Motion {
  /** @param {Part} root */
  constructor(root) {
    this.root = root;
    this.find = (/** @type {string} */ selector) => root.querySelector(selector);
    this.charts = Object.fromEntries(
      CHARTS.map((name) => [name, new Chart(/** @type {any} */ (this.find(`.motion-chart.${name} canvas`)))]),
    );
    this.form = new MotorForm(root, () => this.judgeLater());
    this.sending = new Sending(root, this);
    this.tuning = new Tuning(root, this);
    this.number = 0;
    this.version = 0; // of the settings; `drawn`: of those that `move` is of
    this.drawn = 0;
    /** @type {any} the move that is A, with its settings and what was said of it */
    this.kept = null;
    /** @type {any} what the motor makes of the move, if that is known */
    this.judged = null;
    /** @type {{text: string, kind: string} | null} */
    this.said = null;
    /** @type {any} the axis: an AxisFacts, once there is one */
    this.about = null;
    /** @type {DrawnMove | null} */
    this.move = null;
    this.steps = 1;
    /** @type {Record<string, number>} */
    this.values = {};
    /** @type {Record<string, string>} */
    this.options = {};
    /** @type {any} */
    this.tab = null;
    /** @type {ReturnType<typeof sliders>} */
    this.rows = [];
    this.measure = "";
    this.root.addEventListener("click", (event) => {
      const at = /** @type {Part} */ (event.target),
        tab = at.closest("[role=tab]"),
        key = at.closest("[data-key]");
      if (tab) this.show(tab);
      else if (key && this.actions[key.dataset.key]) this.actions[key.dataset.key]();
    });
    this.find(".motion-of").addEventListener("click", (/** @type {Event} */ event) => {
      event.preventDefault();
      this.find("#motion-motor").scrollIntoView({ block: "center" });
      this.find("select[name=motor]").focus();
    });
    for (const role of ["measure", "lead"])
      this.find(`[data-role=${role}]`).addEventListener("change", () => this.measured());
    this.ends = [
      detent.onTheme(() => Object.values(this.charts).forEach((chart) => chart.paint())),
      detent.on("r.names", (key, names) => key === "r.names" && this.realTabs(names || [])),
    ];
    this.begin();
  }

  close() {
    this.closed = true;
    for (const chart of Object.values(this.charts)) chart.close();
    this.tuning.close();
    for (const end of this.ends) if (typeof end === "function") end();
  }

  /* -- which axis ----------------------------------------------------------------------------------------------- */

  get tabs() {
    return [...this.root.querySelectorAll("[role=tab]")];
  }

  begin() {
    const last = detent.remembered("motion.axis");
    const first = this.tabs.find((tab) => nameOf(/** @type {any} */ (tab.dataset)) === last) || this.tabs[0];
    if (first) this.show(first);
  }

  /**
   * The units that are connected stand behind those of the cell.
   * @param {string[]} names
   */
  realTabs(names) {
    const there = this.tabs.filter((tab) => tab.dataset.real);
    for (const tab of there) if (!names.includes(tab.dataset.unit)) tab.remove();
    for (const name of names)
      if (!there.some((tab) => tab.dataset.unit === name))
        this.find(".motion-units").append(
          element(
            "button",
            {
              type: "button",
              role: "tab",
              class: "key small",
              "data-unit": name,
              "data-axis": "",
              "data-real": "yes",
              "aria-selected": "false",
              "data-help": "A unit that is connected on the Unit page",
            },
            name,
          ),
        );
    if (this.about && this.about.real && !names.includes(this.about.unit) && this.tabs[0]) this.show(this.tabs[0]);
  }

  /** @param {Part} tab */
  async show(tab, options = {}) {
    const { unit, axis, real } = tab.dataset;
    const about = await this.ask("motion_about", { unit, axis, real: Boolean(real), options });
    if (!about || this.closed) return false;
    const other = !this.about || nameOf(this.about) !== nameOf(about);
    this.about = about;
    this.options = options;
    this.tab = tab;
    detent.remember("motion.axis", nameOf(about));
    for (const one of this.tabs) one.setAttribute("aria-selected", String(one === tab));
    this.find(".motion-law").textContent = about.law;
    this.find(".motion-told").textContent = "";
    this.values = { ...about.values };
    this.takeMeasure();
    if (other) {
      this.steps = about.steps;
      this.kept = null;
      this.form.fill(about);
      this.tuning.moved();
    } else this.form.steppings(about);
    this.sliders();
    this.changed();
    return true;
  }

  get place() {
    const { unit, axis, real } = this.about;
    return { unit, axis, real, options: this.options };
  }

  /** What the server is asked about: the axis, its settings and the length of the move. */
  get request() {
    return { ...this.place, values: this.values, steps: this.steps };
  }

  sliders() {
    this.rows = sliders(this.about, {
      values: this.values,
      steps: () => this.steps,
      move: (steps) => {
        this.steps = steps;
      },
      changed: () => this.changed(),
    });
    this.find(".motion-sliders").replaceChildren(...this.rows.map((row) => row.place));
  }

  /**
   * Settings that were found or picked: into the sliders, with the options that they need.
   * @param {{settings: Record<string, number>, options: Record<string, string>, part: Point}} found
   */
  async take({ settings, options, part }) {
    const steps = Math.max(Math.round((this.steps * part[0]) / part[1]), 1);
    const sized = options.table !== undefined || part[0] !== part[1] ? options : this.options;
    if (!(await this.show(this.tab, sized))) return;
    Object.assign(this.values, settings);
    this.steps = Math.min(steps, this.about.most);
    for (const row of this.rows) row.show();
    this.changed();
  }

  /* -- mm, degrees ---------------------------------------------------------------------------------------------- */

  get leadName() {
    return `lead.${this.about.real ? this.about.unit : `${this.about.unit}.${this.about.axis}`}`;
  }

  takeMeasure() {
    let kept = null;
    try {
      kept = JSON.parse(detent.remembered(this.leadName) || "null");
    } catch {
      /* then it is asked again */
    }
    const travel = this.about.fitted && this.about.fitted.travel;
    if (!kept && travel) kept = ["mm", +(this.perTurn(this.about.fitted.steps) / travel).toPrecision(9)];
    this.find("[data-role=measure]").value = kept ? kept[0] : "";
    this.find("[data-role=lead]").value = kept ? kept[1] : "";
    this.showMeasure();
  }

  /** @param {number} steps */
  perTurn(steps) {
    return steps * (this.about.per_step[this.form.stepping] || 1);
  }

  /* Another measure: what a turn is, is known of the motor, and of what it moves. */
  measured() {
    const measure = this.find("[data-role=measure]").value,
      lead = this.find("[data-role=lead]"),
      turn = this.judged && this.judged.turn,
      travel = this.judged && this.judged.travel;
    if (measure !== this.measure) {
      const known = measure === "\u00b0" ? this.perTurn(turn || 200) / 360 : travel ? this.perTurn(turn) / travel : 1;
      lead.value = +known.toPrecision(9);
    }
    detent.remember(this.leadName, JSON.stringify(measure ? [measure, Number(lead.value)] : null));
    this.showMeasure();
    this.paint();
  }

  showMeasure() {
    this.measure = this.find("[data-role=measure]").value;
    this.find("[data-role=lead-label]").hidden = !this.measure;
    this.find("[data-role=lead-unit]").textContent = this.measure;
  }

  /* How lengths are shown: by what they are divided, and their unit. */
  get scale() {
    const steps = Number(this.find("[data-role=lead]").value);
    return this.measure && steps > 0
      ? { by: steps, unit: this.measure }
      : { by: 1, unit: this.about.units };
  }

  /* -- the picture ---------------------------------------------------------------------------------------------- */

  changed() {
    this.version++;
    clearTimeout(this.moveSoon);
    this.moveSoon = setTimeout(() => this.draw(), MOVE_AFTER);
    this.judgeLater();
  }

  /* The move of the settings as they stand, even where it is not drawn yet; undefined if there is none. */
  async settled() {
    while (!this.closed && this.drawn !== this.version) if (!(await this.draw())) return undefined;
    return this.closed ? undefined : this.move;
  }

  /* Whether the server gave an answer; one that came too late for the settings is not shown. */
  async draw() {
    clearTimeout(this.moveSoon);
    const number = ++this.number,
      { version } = this,
      move = await this.ask("motion_move", this.request);
    if (!move || this.closed || number !== this.number) return Boolean(move);
    this.move = move;
    this.drawn = version;
    this.paint();
    const more = Object.entries(this.options).map(([name, value]) => `option ${name} = "${value}"`);
    this.find(".motion-lines").replaceChildren(
      ...[...move.settings, move.go, ...more].map((line) => element("span", {}, line)),
    );
    const burnt = "table" in this.options;
    this.find("[data-key=send]").disabled = !move.settings.length || burnt;
    this.find("[data-key=move]").disabled = burnt;
    if (burnt)
      this.find(".motion-told").textContent =
        "This table is no command: it is burnt into the drive's EPROM, or stands in the cell file as option table.";
    this.root.dataset.drawn = String(number);
    return true;
  }

  /* The move, and A behind it, over one time. */
  paint() {
    const { move, kept } = this;
    if (!move) return;
    const { by, unit: units } = this.scale,
      both = kept ? [kept.move, move] : [move],
      seconds = Math.max(...both.map((one) => one.duration)) * 1e-9,
      small = seconds < 0.5,
      x = small ? "ms" : "s",
      t = small ? 1e3 : 1,
      right = seconds * t * 1.02;
    /**
     * @param {(move: DrawnMove) => Point[]} points
     * @param {string} colour
     */
    const lines = (points, colour) => [
      ...(kept ? [{ points: points(kept.move), colour: "--ink-3", dash: [6, 4], width: 1.5, label: "A" }] : []),
      { points: points(move), colour, fill: !kept, label: kept ? "this move" : "" },
    ];
    /** @param {(one: DrawnMove) => number} of */
    const top = (of) => Math.max(...both.map(of)) || 1;
    this.charts.speed.draw({
      right,
      top: (top((one) => one.peak) / by) * 1.12,
      x,
      y: `${units}/s`,
      lines: lines(
        /** @returns {Point[]} */ (one) => [
          [0, 0],
          ...one.times.map(/** @returns {Point} */ (at, i) => [at * t, one.speeds[i] / by]),
          [one.duration * 1e-9 * t, 0],
        ],
        "--trace-1",
      ),
    });
    const most = top((one) => Math.max(0, ...one.accelerations.map((/** @type {Point} */ point) => point[1]))) / by,
      least = Math.min(0, ...both.map((one) => Math.min(0, ...one.accelerations.map((/** @type {Point} */ point) => point[1])))) / by;
    this.charts.acceleration.draw({
      right,
      top: most * 1.12,
      bottom: least * 1.12,
      x,
      y: `${units}/s\u00b2`,
      lines: lines((one) => one.accelerations.map(([at, a]) => [at * t, a / by]), "--trace-4"),
    });
    this.charts.place.draw({
      right,
      top: (top((one) => one.steps) / by) * 1.08,
      x,
      y: units,
      lines: lines((one) => one.times.map((at, i) => [at * t, one.positions[i] / by]), "--trace-2"),
    });
    this.facts(move, most);
    this.both();
  }

  /**
   * @param {DrawnMove} move
   * @param {number} most
   */
  facts(move, most) {
    const { by, unit: units } = this.scale;
    /**
     * @param {number} value
     * @param {number} figures
     */
    const speed = (value, figures) => `${showNumber(+(value / by).toPrecision(figures))} ${units}/s`;
    const facts = {
      duration: showSpan(move.duration),
      peak: speed(move.peak, 6),
      mean: speed(move.mean, 5),
      accelerates: `${showNumber(+most.toPrecision(4))} ${units}/s\u00b2`,
      up: showSpan(move.up * 1e9),
      down: showSpan(move.down * 1e9),
    };
    for (const [name, text] of Object.entries(facts)) this.find(`[data-fact=${name}]`).textContent = text;
    const peak = this.find("[data-fact=peak]");
    peak.title = move.remark || (move.reached ? "" : "the move is too short for the slew speed");
    if (move.remark) peak.textContent += " (no ramp)";
    else if (!move.reached) peak.textContent += " (too short for the slew speed)";
    peak.classList.toggle("short", !move.reached || !!move.remark);
  }

  /* A and this move, row by row. */
  both() {
    const place = this.find(".motion-both"),
      table = place.firstElementChild,
      { kept, move } = this;
    for (const key of ["swap", "drop"]) this.find(`[data-key=${key}]`).hidden = !kept;
    place.hidden = !kept;
    if (!kept || !move) return;
    /** @param {DrawnMove} one */
    const speed = (one) => `${showNumber(+(one.peak / this.scale.by).toPrecision(5))} ${this.scale.unit}/s`;
    /**
     * @param {string} name
     * @param {DrawnMove} one
     * @param {any} verdict
     */
    const row = (name, one, verdict, more = "") =>
      element(
        "tr",
        {},
        element("th", { scope: "row" }, name),
        element("td", {}, [...one.settings, one.go].join(" ")),
        element("td", {}, showSpan(one.duration), more && element("b", {}, more)),
        element("td", {}, speed(one)),
        element("td", { "data-kind": verdict.kind }, verdict.text || "not judged"),
      );
    const part = 100 * (move.duration / kept.move.duration - 1);
    const heads = ["", "commands", "takes", "peak", "motor"].map((text) => element("th", { scope: "col" }, text));
    table.replaceChildren(
      element("thead", {}, element("tr", {}, ...heads)),
      element(
        "tbody",
        {},
        row("A", kept.move, kept.verdict),
        row("this", move, this.said || {}, ` ${part >= 0 ? "+" : "\u2212"}${Math.abs(part).toFixed(1)} %`),
      ),
    );
  }

  /* -- the motor --------------------------------------------------------------------------------------------------- */

  judgeLater() {
    clearTimeout(this.judgeSoon);
    const asked = this.form.asked();
    if (!asked) {
      this.judged = null;
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
    const { torque } = this.charts;
    this.judging = true;
    if (!torque.what || "note" in torque.what) torque.draw({ note: "Computing \u2026" });
    this.root.toggleAttribute("data-judging", true);
    let found = null,
      words = "";
    try {
      found = await detent.call("motion_motor", this.request, this.form.asked());
    } catch (error) {
      words = wordsOf(error);
    }
    this.judging = false;
    if (this.closed) return;
    if (this.again) {
      this.again = false;
      this.judge();
      return;
    }
    this.root.toggleAttribute("data-judging", false);
    this.judged = found;
    this.find(".motion-words").textContent = found ? found.words : words;
    if (!found) {
      this.verdict("cannot be judged so", "bad");
      torque.draw({ note: "This motor cannot be judged so." });
      return;
    }
    this.paintTorque();
    const { verdict } = found;
    if (!verdict) this.verdict("", "");
    else if (verdict.lost) this.verdict("steps lost", "bad");
    else if (verdict.often) this.verdict(`no step lost, but by ${verdict.often} of ${verdict.of} variants`, "bad");
    else if (verdict.of) this.verdict(`no step lost, by none of ${verdict.of} variants`, "good");
    else this.verdict("no step lost", "good");
    if (this.move) this.both();
  }

  paintTorque() {
    const { judged: found, kept } = this,
      positive = (/** @type {Point[]} */ points) => points.map(/** @returns {Point} */ ([speed, torque]) => [speed, Math.max(torque, 0)]);
    const curve = positive(found.curve),
      before = kept && kept.judged ? kept.judged.asked : [];
    const all = [...curve, ...found.asked, ...before];
    this.charts.torque.draw({
      right: Math.max(...all.map(([speed]) => speed)) * 1.02,
      top: 1.15 * Math.max(...all.map(([, torque]) => torque)),
      x: `${this.about.units}/s`,
      y: "Nm",
      lines: [
        { points: [[0, curve[0][1]], ...curve], colour: "--trace-3", fill: true, label: "the motor gives" },
        { points: before, colour: "--ink-3", dash: [6, 4], label: before.length ? "A asks" : "" },
        { points: found.asked, colour: "--trace-2", width: 2.5, label: "the move asks" },
      ],
    });
  }

  /**
   * @param {string} text
   * @param {string} kind
   */
  verdict(text, kind) {
    const place = this.find(".motion-verdict");
    this.said = { text, kind };
    place.textContent = text;
    place.dataset.kind = kind;
    this.find(".motion-of").textContent = this.form.title;
  }

  /* -- keys ---------------------------------------------------------------------------------------------------- */

  /**
   * What the keys do, by their `data-key`.
   * @returns {Record<string, () => any>}
   */
  get actions() {
    return {
      send: () => this.whenSendable("send", (move, ask) => this.sending.settings(move.settings, ask)),
      move: () => this.whenSendable("move", (move, ask) => this.sending.move([...move.settings, move.go], ask)),
      now: () => this.show(this.tab),
      keep: () =>
        this.whenSettled(() => {
          this.kept = this.current();
          this.paint();
          if (this.judged) this.paintTorque();
        }),
      swap: async () => {
        if (!(await this.settled())) return;
        const back = this.kept;
        this.kept = this.current();
        if (!(await this.show(this.tab, back.options))) return;
        Object.assign(this.values, back.values);
        this.steps = back.steps;
        for (const row of this.rows) row.show();
        this.changed();
      },
      drop: () => {
        this.kept = null;
        this.paint();
        if (this.judged) this.paintTorque();
      },
      csv: () => this.whenSettled(() => exported(this, "csv")),
      png: () => this.whenSettled(() => exported(this, "png")),
      ...this.tuning.actions,
    };
  }

  /**
   * What a key does, with the move that is meant and not with the one that was drawn last.
   * @param {(move: DrawnMove) => any} act
   */
  async whenSettled(act) {
    const move = await this.settled();
    if (move) await act(move);
  }

  /**
   * The same for what goes to a unit: nothing does if the settings that are meant are no commands.
   * @param {string} key
   * @param {(move: DrawnMove, ask: Detent["call"]) => any} act
   */
  async whenSendable(key, act) {
    const ask = detent.asking(), // a STOP may come before it is settled
      move = await this.settled();
    if (move && !this.find(`[data-key=${key}]`).disabled) await act(move, ask);
  }

  current() {
    const { move, judged, said, steps } = this;
    return { move, judged, verdict: said || {}, values: { ...this.values }, options: { ...this.options }, steps };
  }

  /**
   * @template {keyof Calls} Name
   * @param {Name} name
   * @param {Parameters<Calls[Name]>} values
   * @returns {Promise<ReturnType<Calls[Name]> | undefined>}
   */
  async ask(name, ...values) {
    try {
      return await detent.call(name, ...values);
    } catch (error) {
      detent.failed(error);
      return undefined;
    }
  }
}

/** @param {{unit: string, axis: string, real?: any}} place */
function nameOf({ unit, axis, real }) {
  return `${real ? "r:" : ""}${unit}.${axis}`;
}

detent.part("motion", (root) => {
  const motion = new Motion(root);
  root.motion = motion; // for tests and for the curious
  return () => motion.close();
});
