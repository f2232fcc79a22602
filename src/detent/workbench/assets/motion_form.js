/* The motor of the Motion page: which, with which drive, what it moves. `asked` is what the server takes (rigs.py). */

import { element } from "./elements.js";

const NUMBERS = ["supply", "current", "inertia", "friction", "damping"],
  MOVED = ["size", "gear", "mass", "slope", "force", "drag"];

/** @typedef {Pick<MotorFacts, keyof MotorFacts & keyof FittedMotor> & Partial<MotorFacts & FittedMotor>} AnyMotor by name, or fitted */

export class MotorForm {
  /**
   * @param {Part} root
   * @param {() => void} changed
   */
  constructor(root, changed) {
    this.form = root.querySelector("form.motion-form");
    this.fields = this.form.elements;
    this.changed = changed;
    /** @type {{name: string, text: string, curve: string, curve_name: string, facts: MotorFacts} | null} */
    this.own = null;
    /** @type {AxisFacts | null} */
    this.about = null;
    this.form.addEventListener("input", (event) => this.touched(/** @type {any} */ (event.target).name));
    this.form.addEventListener("submit", (event) => event.preventDefault());
  }

  get stepping() {
    return this.fields.stepping.value;
  }

  /* The motor in a few words. */
  get title() {
    const { motor } = this.fields;
    if (!motor.value) return "no motor chosen";
    return `${motor.value === "fitted" ? this.about?.fitted?.name : motor.value === "own" ? this.own?.name : motor.value}:`;
  }

  /** @param {AxisFacts} about */
  fill(about) {
    const { motors, fitted, drives } = about,
      { motor, drive } = this.fields;
    this.about = about;
    motor.replaceChildren(
      ...(fitted
        ? [element("option", { value: "fitted" }, `${fitted.name} (${fitted.motor}, in the cell)`)]
        : [element("option", { value: "" }, "none")]),
      ...(this.own ? [element("option", { value: "own" }, `${this.own.name} (own)`)] : []),
      ...motors.map(({ name, title }) => element("option", { value: name, title }, name)),
    );
    drive.replaceChildren(
      element("option", { value: "" }, fitted ? "as in the cell" : "fast decay"),
      ...drives.map((name) => element("option", { value: name }, name)),
    );
    const kept = detent.remembered("motion.motor") || "";
    motor.value = fitted ? "fitted" : motors.some(({ name }) => name === kept) ? kept : "";
    this.steppings(about);
    this.takeMotor();
  }

  /** @param {AxisFacts} about */
  steppings(about) {
    const { stepping } = this.fields,
      before = stepping.value;
    this.about = about;
    stepping.replaceChildren(...about.steppings.map((name) => element("option", { value: name }, name)));
    stepping.value = about.steppings.includes(before) ? before : about.stepping;
  }

  /** @returns {AnyMotor | null | undefined} */
  get found() {
    const { motor } = this.fields;
    if (motor.value === "own") return this.own?.facts;
    return motor.value === "fitted" ? this.about?.fitted : this.about?.motors.find(({ name }) => name === motor.value);
  }

  takeMotor() {
    const { found, fields } = this,
      named = fields.motor.value !== "fitted" && fields.motor.value !== "own";
    for (const field of this.fields) if (!["motor", "files"].includes(field.name)) field.disabled = !found;
    const wirings = found && named ? found.wirings : [];
    fields.wiring.replaceChildren(
      ...wirings.map((/** @type {string} */ name) => element("option", { value: name }, name === found?.wiring ? `${name} (as sold)` : name)),
    );
    if (found) fields.wiring.value = found.wiring || "";
    this.form.querySelector("[data-role=wiring]").hidden = !wirings.length;
    this.form.querySelector("[data-role=fit]").hidden = !(found && named && found.curve);
    fields.fit.checked = false;
    if (!found) return;
    fields.stepping.value = found.stepping || this.about?.stepping;
    fields.supply.value = found.supply;
    fields.current.value = found.current;
    fields.inertia.value = +found.inertia.toPrecision(4);
    fields.friction.value = found.friction || 0;
    fields.damping.value = found.damping;
  }

  /** @param {string} name */
  async touched(name) {
    if (name === "files") await this.takeFiles([...this.fields.files.files]);
    if (name === "motor") {
      detent.remember("motion.motor", this.fields.motor.value);
      this.takeMotor();
    }
    if (name === "by")
      this.form.querySelector("[data-role=size]").textContent =
        this.fields.by.value === "screw" ? "lead, mm a turn" : this.fields.by.value ? "radius, mm" : "lead or radius, mm";
    this.changed();
  }

  /**
   * A motor of somebody's own: one TOML, and its curve if there is one.
   * @param {File[]} files
   */
  async takeFiles(files) {
    const toml = files.find((file) => file.name.endsWith(".toml")),
      csv = files.find((file) => file.name.endsWith(".csv"));
    if (!toml) {
      if (files.length) detent.toast("Choose the TOML file of the motor, and its CSV with it", "error");
      return;
    }
    if (files.some((file) => file.size > 200000)) {
      detent.toast("A file of a motor has at most 200 kB", "error");
      return;
    }
    const own = { name: toml.name, text: await toml.text(), curve: csv ? await csv.text() : "", curve_name: csv ? csv.name : "" };
    try {
      this.own = { ...own, facts: await detent.call("motion_own", { name: own.name, text: own.text }) };
    } catch (error) {
      detent.failed(error);
      return;
    }
    this.fields.motor.querySelector("[value=own]")?.remove();
    this.fields.motor.prepend(element("option", { value: "own" }, `${own.name} (own)`));
    this.fields.motor.value = "own";
    this.takeMotor();
  }

  /* What the server takes; null without a motor. */
  asked() {
    const { fields, found } = this;
    if (!this.about || !found) return null;
    const motor = fields.motor.value,
      number = (/** @type {string} */ name) => [name, Number(fields[name].value)];
    const { name, text, curve, curve_name } = this.own || { name: "", text: "", curve: "", curve_name: "" };
    return {
      motor: motor === "fitted" ? found.motor : motor,
      stepping: fields.stepping.value,
      ...Object.fromEntries(NUMBERS.map(number)),
      drive: fields.drive.value,
      wiring: fields.wiring.value && fields.wiring.value !== found.wiring ? fields.wiring.value : "",
      fit: fields.fit.checked,
      own: motor === "own" ? { name, text, curve, curve_name } : null,
      moved: { by: fields.by.value, ...Object.fromEntries(MOVED.map(number)) },
    };
  }
}
