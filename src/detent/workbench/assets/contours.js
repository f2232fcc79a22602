// The lines of equal value on a map of numbers, where a value is on it, and its shades. Knows no page.

/**
 * @param {number} value
 * @param {number} count
 */
export const within = (value, count) => Math.min(Math.max(value, 0), count - 1);

/**
 * @param {number[]} values
 * @param {number} wanted
 */
export function nearestOf(values, wanted) {
  return values.reduce((best, value, i) => (Math.abs(value - wanted) < Math.abs(values[best] - wanted) ? i : best), 0);
}

/**
 * Where between the cells a value is; the cells are even in proportions.
 * @param {number[]} values
 * @param {number} wanted
 */
export function between(values, wanted) {
  for (let i = 0; i + 1 < values.length; i++)
    if (wanted <= values[i + 1]) return i + Math.log(Math.max(wanted, values[i]) / values[i]) / Math.log(values[i + 1] / values[i]);
  return values.length - 1;
}

/**
 * The pieces of the line on which a field of numbers has `level`, between the middles of its cells.
 * @param {(number | null)[][]} rows
 * @param {number} level
 */
export function segments(rows, level) {
  /** @type {[Point, Point][]} */
  const found = [];
  for (let j = 0; j + 1 < rows.length; j++)
    for (let i = 0; i + 1 < rows[j].length; i++) {
      const corners = [
        { x: i, y: j, value: rows[j][i] },
        { x: i + 1, y: j, value: rows[j][i + 1] },
        { x: i + 1, y: j + 1, value: rows[j + 1][i + 1] },
        { x: i, y: j + 1, value: rows[j + 1][i] },
      ];
      /** @type {Point[]} */
      const crossed = [];
      if (corners.some(({ value }) => value === null)) continue;
      corners.forEach(({ x, y, value }, k) => {
        const { x: x2, y: y2, value: value2 } = corners[(k + 1) % 4];
        if (value === null || value2 === null || value < level === value2 < level) return;
        const part = (level - value) / (value2 - value);
        crossed.push([x + part * (x2 - x), y + part * (y2 - y)]);
      });
      for (let k = 0; k + 1 < crossed.length; k += 2) found.push([crossed[k], crossed[k + 1]]);
    }
  return found;
}

/** @param {string} text */
export function rgb(text) {
  const value = parseInt(text.replace("#", ""), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

/**
 * @param {number[][]} shades
 * @param {number} part
 */
export function shade(shades, part) {
  const at = Math.min(part, 1) * (shades.length - 1),
    k = Math.min(Math.floor(at), shades.length - 2);
  const mixed = shades[k].map((value, n) => Math.round(value + (at - k) * (shades[k + 1][n] - value)));
  return `rgb(${mixed.join(",")})`;
}
