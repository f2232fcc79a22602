/* A small chart on a canvas: lines over two linear axes from 0, with their units. Colours come from the style sheet. */

import { niceStep, showNumber } from "./scope_plot.js";

const MARGIN = { left: 58, right: 14, top: 12, bottom: 24 };

export class Chart {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.what = null;
    this.watcher = new ResizeObserver(() => this.paint());
    this.watcher.observe(canvas.parentElement);
  }

  close() {
    this.watcher.disconnect();
  }

  /* Draw `what`: {right, top (ends of the axes), x, y (units), lines: [{points: [[x, y]], colour, width, dash, fill,
     label, end}]}, or {note}: words in place of a chart. */
  draw(what) {
    this.what = what;
    this.paint();
  }

  paint() {
    const { canvas, pen, what } = this,
      ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas.parentElement;
    if (!width || !height) return;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!what) return;
    const style = getComputedStyle(canvas),
      colour = (name) => style.getPropertyValue(name).trim();
    const w = width - MARGIN.left - MARGIN.right,
      h = height - MARGIN.top - MARGIN.bottom;
    const x = (value) => MARGIN.left + (value / what.right) * w,
      y = (value) => MARGIN.top + h - (value / what.top) * h;
    pen.font = `11px ${colour("--mono")}`;
    pen.lineWidth = 1;
    if (what.note) {
      // in place of a chart
      pen.fillStyle = colour("--ink-2");
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(what.note, width / 2, height / 2);
      return;
    }
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
        pen.lineTo(x(line.points.at(-1)[0]), y(0));
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
    pen.textBaseline = "middle";
    for (const { points, label, colour: name, end } of what.lines) {
      if (!label || !points.length) continue;
      const [a, b] = end ? points.at(-1) : points[Math.floor(points.length * 0.4)];
      const room = pen.measureText(label).width;
      pen.fillStyle = colour(name);
      pen.textAlign = "left";
      pen.fillText(
        label,
        Math.min(Math.max(x(a) + 4, MARGIN.left + 4), width - MARGIN.right - room),
        Math.max(y(b) - 10, 8),
      );
    }
  }

  grid({ pen, colour, x, y, w, h, what }) {
    const across = niceStep(what.right / Math.max(w / 86, 2)),
      up = niceStep(what.top / Math.max(h / 34, 2));
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
    for (let k = 0; k * up <= what.top * 1.0001; k++) {
      const at = Math.round(y(k * up)) + 0.5;
      pen.moveTo(MARGIN.left - 4, at);
      pen.lineTo(MARGIN.left + w, at);
      pen.fillText(showNumber(k * up, up), MARGIN.left - 8, at);
    }
    pen.stroke();
    pen.textAlign = "left";
    pen.fillText(what.y, MARGIN.left + 6, MARGIN.top + 4);
  }
}
