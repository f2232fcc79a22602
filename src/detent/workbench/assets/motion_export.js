/* The curves of the Motion page as a table, and the page as a picture. Both are made here, in the browser. */

import { element } from "./elements.js";

/**
 * Let the browser keep the move that is shown, and A if there is one.
 * @param {import("./motion.js").Motion} motion
 * @param {string} kind
 */
export function exported(motion, kind) {
  if (!motion.move) return;
  const { unit, axis } = motion.about,
    file = `${[unit, axis].filter(Boolean).join("-").replace(/[^\w.-]+/g, "_")}-move.${kind}`;
  if (kind === "csv") keep(file, new Blob([table(motion)], { type: "text/csv" }));
  else picture(motion).toBlob((blob) => blob && keep(file, blob), "image/png");
}

/**
 * @param {string} file
 * @param {Blob} blob
 */
function keep(file, blob) {
  const link = element("a", { href: URL.createObjectURL(blob), download: file });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/**
 * A line of names with units, and a line for each point; accelerations are between the points that they are known at.
 * @param {import("./motion.js").Motion} motion
 */
function table(motion) {
  const { by, unit } = motion.scale,
    moves = motion.kept ? [["A", motion.kept.move], ["this", motion.move]] : [["this", motion.move]];
  const rows = [["move", "commands", "s", unit, `${unit}/s`, `${unit}/s2`]];
  for (const [name, move] of moves) {
    const commands = [...move.settings, move.go].join(" ");
    let k = 0;
    move.times.forEach((/** @type {number} */ at, /** @type {number} */ i) => {
      const points = move.accelerations;
      while (k < points.length - 1 && points[k + 1][0] <= at) k++;
      const after = points[Math.min(k + 1, points.length - 1)],
        before = points[k];
      const part = !before || at <= before[0] || after === before ? 0 : (at - before[0]) / (after[0] - before[0]);
      const acceleration = before ? before[1] + Math.min(part, 1) * (after[1] - before[1]) : "";
      rows.push([
        name,
        commands,
        at,
        +(move.positions[i] / by).toPrecision(9),
        +(move.speeds[i] / by).toPrecision(9),
        acceleration === "" ? "" : +(acceleration / by).toPrecision(6),
      ]);
    });
  }
  return rows.map((row) => row.map((cell) => (/[",]/.test(cell) ? `"${String(cell).replaceAll('"', '""')}"` : cell)).join(",")).join("\n") + "\n";
}

/**
 * The charts below each other, under a line that says what they are.
 * @param {import("./motion.js").Motion} motion
 */
function picture(motion) {
  const charts = Object.values(motion.charts).filter(({ what }) => what && !("note" in what)),
    ratio = window.devicePixelRatio || 1,
    style = getComputedStyle(motion.root),
    colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const head = 56 * ratio,
    map = motion.tuning.canvas(),
    /** @type {any[]} */
    all = [...charts.map(({ canvas }) => canvas), ...(map ? [map] : [])];
  const copy = element("canvas");
  copy.width = Math.max(...all.map(({ width }) => width));
  copy.height = head + all.reduce((sum, { height }) => sum + height, 0);
  const pen = /** @type {CanvasRenderingContext2D} */ (copy.getContext("2d"));
  pen.fillStyle = colour("--panel");
  pen.fillRect(0, 0, copy.width, copy.height);
  pen.save();
  pen.scale(ratio, ratio);
  pen.fillStyle = colour("--ink");
  pen.font = `600 14px ${colour("--sans")}`;
  const { move, kept, about } = motion,
    said = (/** @type {DrawnMove} */ one) => [...one.settings, one.go].join(" ");
  pen.fillText(`${about.unit} (${about.model}): ${said(/** @type {DrawnMove} */ (move))}${kept ? `   A: ${said(kept.move)}` : ""}`, 12, 20, copy.width / ratio - 24);
  pen.font = `12px ${colour("--sans")}`;
  pen.fillStyle = colour("--ink-2");
  pen.fillText(`${motion.form.title} ${(motion.said || {}).text || ""}`, 12, 42, copy.width / ratio - 24);
  pen.restore();
  let top = head;
  for (const canvas of all) {
    pen.drawImage(canvas, 0, top);
    top += canvas.height;
  }
  return copy;
}
