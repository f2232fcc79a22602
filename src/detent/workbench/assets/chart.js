/* A small chart on a canvas: lines over two linear axes, x from 0, with their units. Units and labels stand above the
   lines, never on them. Colours come from the style sheet. */

import { niceStep, showNumber } from "./scope_plot.js";

/**
 * @typedef {{points: Point[], colour: string, width?: number, dash?: number[], fill?: boolean, label?: string}} Line
 * @typedef {{right: number, top: number, bottom?: number, x: string, y: string, lines: Line[]}} Plotted the ends of the axes
 *   (bottom is 0 unless given), their units, the lines
 * @typedef {Plotted | {note: string}} Drawing a chart, or words in place of one
 */

const MARGIN = { left: 58, right: 14, top: 24, bottom: 24 };
const ROUND = 11; // px: how high type is

/**
 * The size and the colours of a canvas that fills its parent, sharp on every screen, and wiped.
 * @param {HTMLCanvasElement} canvas
 * @param {CanvasRenderingContext2D} pen
 */
export function fitted(canvas, pen) {
  const ratio = window.devicePixelRatio || 1,
    { clientWidth: width, clientHeight: height } = /** @type {Part} */ (canvas.parentElement),
    style = getComputedStyle(canvas);
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { width, height, colour: (/** @type {string} */ name) => style.getPropertyValue(name).trim() };
}

export class Chart {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    /** @type {Drawing | null} */
    this.what = null;
    this.watcher = new ResizeObserver(() => this.paint());
    this.watcher.observe(/** @type {Part} */ (canvas.parentElement));
  }

  close() {
    this.watcher.disconnect();
  }

  /**
   * Draw lines over two axes, or words in place of a chart.
   * @param {Drawing} what
   */
  draw(what) {
    this.what = what;
    this.paint();
  }

  paint() {
    const { canvas, pen, what } = this,
      { width, height, colour } = fitted(canvas, pen);
    if (!width || !height || !what) return;
    pen.font = `11px ${colour("--mono")}`;
    pen.lineWidth = 1;
    if ("note" in what) {
      pen.fillStyle = colour("--ink-2");
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(what.note, width / 2, height / 2);
      return;
    }
    const w = width - MARGIN.left - MARGIN.right,
      h = height - MARGIN.top - MARGIN.bottom;
    const x = (/** @type {number} */ value) => MARGIN.left + (value / what.right) * w,
      bottom = what.bottom || 0,
      y = (/** @type {number} */ value) => MARGIN.top + h - ((value - bottom) / (what.top - bottom)) * h;
    this.grid({ pen, colour, x, y, w, h, what });
    pen.save();
    pen.beginPath();
    pen.rect(MARGIN.left, MARGIN.top - 2, w + 3, h + 4);
    pen.clip();
    for (const line of what.lines) {
      if (!line.points.length) continue;
      pen.beginPath();
      line.points.forEach(([a, b], i) => (i ? pen.lineTo(x(a), y(b)) : pen.moveTo(x(a), y(b))));
      pen.strokeStyle = pen.fillStyle = colour(line.colour);
      if (line.fill) {
        pen.save();
        pen.lineTo(x(line.points[line.points.length - 1][0]), y(0));
        pen.lineTo(x(line.points[0][0]), y(0));
        pen.globalAlpha = 0.12;
        pen.fill();
        pen.restore();
        pen.beginPath();
        line.points.forEach(([a, b], i) => (i ? pen.lineTo(x(a), y(b)) : pen.moveTo(x(a), y(b))));
      }
      pen.lineWidth = line.width || 2;
      pen.lineJoin = "round";
      pen.setLineDash(line.dash || []);
      pen.stroke();
      pen.setLineDash([]);
    }
    pen.restore();
    this.legend({ pen, colour, width, lines: what.lines });
  }

  /**
   * What each line is, above them from the right; what has no room is left out.
   * @param {{pen: CanvasRenderingContext2D, colour: Colour, width: number, lines: Line[]}} on
   */
  legend({ pen, colour, width, lines }) {
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    let right = width - MARGIN.right;
    for (const { label, colour: name, dash } of [...lines].reverse()) {
      if (!label) continue;
      const left = right - pen.measureText(label).width;
      if (left < MARGIN.left + 90) break;
      pen.fillStyle = colour("--ink-2");
      pen.fillText(label, left, ROUND);
      pen.strokeStyle = colour(name);
      pen.lineWidth = 2;
      pen.setLineDash(dash || []);
      pen.beginPath();
      pen.moveTo(left - 24, ROUND);
      pen.lineTo(left - 6, ROUND);
      pen.stroke();
      pen.setLineDash([]);
      right = left - 36;
    }
  }

  /**
   * @param {{pen: CanvasRenderingContext2D, colour: Colour, x: (value: number) => number, y: (value: number) => number, w: number,
   *   h: number, what: Plotted}} on
   */
  grid({ pen, colour, x, y, w, h, what }) {
    const across = niceStep(what.right / Math.max(w / 86, 2)),
      bottom = what.bottom || 0,
      up = niceStep((what.top - bottom) / Math.max(h / 20, 2));
    pen.strokeStyle = colour("--line");
    pen.fillStyle = colour("--ink-2");
    pen.beginPath();
    pen.textBaseline = "top";
    pen.textAlign = "center";
    for (let k = 0; k * across <= what.right * 1.0001; k++) {
      const at = Math.round(x(k * across)) + 0.5;
      pen.moveTo(at, MARGIN.top);
      pen.lineTo(at, MARGIN.top + h + 4);
      if (at < MARGIN.left + w - 46 || !what.x) pen.fillText(showNumber(k * across, across), at, MARGIN.top + h + 8);
    }
    pen.textAlign = "right";
    pen.fillText(what.x, MARGIN.left + w + 8, MARGIN.top + h + 8);
    pen.textBaseline = "middle";
    for (let k = Math.ceil(bottom / up - 1e-4); k * up <= what.top * 1.0001; k++) {
      const at = Math.round(y(k * up)) + 0.5;
      pen.moveTo(MARGIN.left - 4, at);
      pen.lineTo(MARGIN.left + w, at);
      pen.fillText(showNumber(k * up, up), MARGIN.left - 8, at);
    }
    pen.stroke();
    pen.textAlign = "left";
    pen.fillText(what.y, 8, ROUND);
  }
}
