// How numbers and times are written on every page, and how a scale is divided. Knows no page.

export const THIN = "\u2009";
export const MINUS = "\u2212";

/**
 * A whole number in groups of three.
 * @param {number} number
 */
export function grouped(number) {
  const text = Math.abs(number).toString().replace(/\B(?=(\d{3})+$)/g, THIN);
  return number < 0 ? MINUS + text : text;
}

/**
 * Nanoseconds as seconds, to the microsecond.
 * @param {number | null | undefined} ns
 */
export function seconds(ns) {
  if (ns === null || ns === undefined) return "\u2013";
  const micro = Math.floor(ns / 1000);
  const whole = Math.floor(micro / 1e6);
  const rest = String(micro % 1e6).padStart(6, "0");
  return `${grouped(whole)}.${rest.slice(0, 3)}${THIN}${rest.slice(3)}`;
}

/**
 * How the values of the live table are written, by the word in `data-form`.
 * @type {Record<string, (value: any) => string>}
 */
export const FORMS = {
  plain: (value) => (value === null || value === undefined ? "" : String(value)),
  time: seconds,
  steps: (value) => (value === null || value === undefined ? "\u2013" : (value > 0 ? "+" : "") + grouped(Math.round(value))),
  count: (value) => (value === null || value === undefined ? "\u2013" : grouped(Math.round(value))),
  rate: (value) => (value === null || value === undefined ? "\u2013" : grouped(Math.round(value))),
  level: (value) => (value === null || value === undefined || value === "" ? "\u00b7" : String(value)),
  fixed: (value) => (value === null || value === undefined ? "\u2013" : (value < 0 ? MINUS : "") + Math.abs(value).toFixed(2)),
  pace: (value) => (value === null || value === undefined ? "as fast as it goes" : `${Number(value.toPrecision(3))}\u00d7`),
};

/**
 * What is wrong, in words, whatever was thrown.
 * @param {unknown} error
 */
export const wordsOf = (error) => (error instanceof Error ? error.message : String(error));

/**
 * Steps of 1, 2, 5 times a power of ten in which `span` has at most `most` parts.
 * @param {number} span
 * @param {number} most
 */
export function pitch(span, most) {
  const raw = span / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * ([1, 2, 5].find((n) => n * power >= raw) || 10);
}

/**
 * The same length by another measure, as a field has it; what is no number stays what it is. Another measure moves nothing.
 * @param {string} written
 * @param {number} before steps in one of the measure in which it is written
 * @param {number} after steps in one of the other
 */
export function remeasured(written, before, after) {
  const value = Number(written);
  if (written.trim() === "" || !Number.isFinite(value) || before === after) return written;
  return String(+((value * before) / after).toPrecision(9));
}

/**
 * A name without the words with which another begins, too: what tells them apart is seen where there is little room.
 * @param {string} name
 * @param {string} other
 */
export function apart(name, other) {
  const words = name.split(" ");
  const others = other.split(" ");
  const same = words.findIndex((word, n) => word !== others[n]);
  return same > 0 ? `\u2026 ${words.slice(same).join(" ")}` : name;
}

/**
 * A length in whole steps. Throws what is wrong with it, in words.
 * @param {number} value
 */
export function wholeSteps(value) {
  const steps = Math.round(value);
  if (Math.abs(steps) < 2 ** 31) return steps;
  throw new Error(`${steps.toPrecision(3)} steps are farther than any of these controllers goes.`);
}
