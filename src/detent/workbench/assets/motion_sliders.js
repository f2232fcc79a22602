/* The settings of a move as sliders with exact numbers beside them, each in the unit's own counts. What a number is
   brought to is said: a range that is left, a count that is rounded to. */

import { element } from "./elements.js";

/** @typedef {Omit<SettingFacts, "value"> & {get: () => number, set: (value: number) => void}} Row */

const NOTCHES = 1000; // of a slider
/** @type {Record<string, number>} */
const STEPS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
const WIDE = 50; // from so many times the least on, a slider counts in proportions

/**
 * A row for each setting and for the length of the move. `of`: values (changed in place), steps() and move(steps) for the
 * length, changed() after each change.
 * @param {AxisFacts} about
 * @param {{values: Record<string, number>, steps: () => number, move: (steps: number) => void, changed: () => void}} of
 */
export function sliders(about, of) {
  const { settings, most, units } = about;
  /** @type {Row[]} */
  const rows = settings.map((setting) => ({
    ...setting,
    get: () => of.values[setting.name],
    set: (value) => {
      of.values[setting.name] = value;
    },
  }));
  rows.push({
    name: "steps",
    title: "move length",
    unit: units,
    low: 1,
    high: most,
    scale: 1,
    get: of.steps,
    set: of.move,
  });
  return rows.map((row) => slider(row, of.changed));
}

/**
 * @param {Row} row
 * @param {() => void} changed
 */
function slider(row, changed) {
  const wide = row.high / Math.max(row.low, 1) > WIDE,
    shift = row.low < 1 ? 1 : 0;
  /** @param {number} value */
  const notch = (value) =>
    wide
      ? (NOTCHES * Math.log((value + shift) / (row.low + shift))) / Math.log((row.high + shift) / (row.low + shift))
      : (NOTCHES * (value - row.low)) / Math.max(row.high - row.low, 1);
  /** @param {number} at */
  const value = (at) => {
    const exact = wide
      ? (row.low + shift) * ((row.high + shift) / (row.low + shift)) ** (at / NOTCHES) - shift
      : row.low + (at / NOTCHES) * (row.high - row.low);
    const size = wide ? 10 ** Math.max(Math.floor(Math.log10(Math.max(exact, 1))) - 1, 0) : 1; // two figures will do
    return within(Math.round(exact / size) * size);
  };
  /** @param {number} number */
  const within = (number) => Math.min(Math.max(number, row.low), row.high);
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
    range.value = String(notch(row.get()));
    if (document.activeElement !== exact) exact.value = String(row.get() * row.scale);
    range.setAttribute("aria-valuetext", `${row.get() * row.scale} ${row.unit}`);
  };
  range.addEventListener("input", () => {
    limit.textContent = "";
    row.set(value(Number(range.value)));
    exact.value = String(row.get() * row.scale);
    changed();
  });
  range.addEventListener("keydown", (event) => {
    // one count at a time
    const by = STEPS[event.key];
    if (!by) return;
    event.preventDefault();
    row.set(within(row.get() + by));
    show();
    changed();
  });
  exact.addEventListener("input", () => {
    const written = Number(exact.value);
    if (!exact.value || !Number.isFinite(written)) {
      limit.textContent = `give a number: ${row.get() * row.scale} is meant`;
      return;
    }
    row.set(within(Math.round(written / row.scale)));
    const meant = row.get() * row.scale;
    limit.textContent =
      meant === written
        ? ""
        : written < row.low * row.scale || written > row.high * row.scale
          ? `takes ${row.low * row.scale} to ${row.high * row.scale} ${row.unit}: ${meant} is meant`
          : `counts in ${row.scale === 1 ? "whole numbers" : `steps of ${row.scale}`}: ${meant} is meant`;
    range.value = String(notch(row.get()));
    changed();
  });
  exact.addEventListener("change", () => {
    exact.value = String(row.get() * row.scale);
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
