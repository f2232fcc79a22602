/* The map of losses: a cell for each pair of settings, lines of equal time over it, the settings that were found as a
   star. A click, or the arrow keys and Enter, take a place over. */

import { fitted } from "./chart.js";
import { between, nearestOf, rgb, segments, shade, within } from "./contours.js";
import { showNumber } from "./scope_plot.js";

const MARGIN = { left: 58, right: 16, top: 26, bottom: 40 };
/** @type {Record<string, Point>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const LEVELS = 8; // lines of equal time
const SHADES = ["--loss-0", "--loss-1", "--loss-2", "--loss-3"]; // none, some, most, all

export class LossMap {
  /**
   * @param {Part} place
   * @param {(x: number, y: number) => void} picked
   */
  constructor(place, picked) {
    this.place = place;
    this.field = place.querySelector(".motion-map-field");
    this.canvas = place.querySelector("canvas");
    this.told = place.querySelector(".motion-map-told");
    this.pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.picked = picked;
    /** @type {any} */
    this.map = null;
    /** @type {Point | null} of the cell that is looked at */
    this.at = null;
    /** @type {{left: number, top: number, w: number, h: number} | null} */
    this.box = null;
    this.watcher = new ResizeObserver(() => this.paint());
    this.watcher.observe(this.field);
    this.field.addEventListener("pointermove", (event) => this.look(this.under(event)));
    this.field.addEventListener("click", (event) => {
      const cell = this.under(event);
      this.look(cell);
      if (cell) this.takeHere();
    });
    this.field.addEventListener("keydown", (event) => this.key(event));
    this.field.addEventListener("focus", () => this.map && !this.at && this.look(this.nearest()));
  }

  close() {
    this.watcher.disconnect();
  }

  /**
   * Another map, or none.
   * @param {any} map
   */
  take(map) {
    if (map === this.map) return;
    this.map = map;
    this.at = null;
    this.place.hidden = !map;
    this.say("");
    this.paint();
  }

  /** @param {string} text */
  say(text) {
    this.told.textContent = text;
  }

  /** @param {any} event */
  key(event) {
    if (!this.map) return;
    const by = ARROWS[event.key];
    if (by) {
      const [i, j] = this.at || this.nearest();
      this.look([within(i + by[0], this.map.x.length), within(j + by[1], this.map.y.length)]);
    } else if (event.key === "Enter" || event.key === " ") this.takeHere();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  takeHere() {
    const { map, at } = this;
    if (at && map) this.picked(map.x[at[0]], map.y[at[1]]);
  }

  /** @param {Point | null} cell */
  look(cell) {
    if (!this.map || !cell || (this.at && this.at[0] === cell[0] && this.at[1] === cell[1])) return;
    this.at = cell;
    const { map } = this,
      [i, j] = cell,
      lost = map.lost[j][i];
    const where = `${map.names[0]} ${map.x[i]}, ${map.names[1]} ${map.y[j]}`;
    this.say(
      lost === null
        ? `${where}: no such settings`
        : `${where}: ${Math.round(lost * map.variants)} of ${map.variants} lost, ${map.times[j][i].toFixed(4)} s`,
    );
    this.paint();
  }

  /**
   * The cell under a pointer.
   * @param {MouseEvent} event
   * @returns {Point | null}
   */
  under(event) {
    if (!this.map || !this.box) return null;
    const edge = this.canvas.getBoundingClientRect(),
      { left, top, w, h } = this.box,
      i = Math.floor(((event.clientX - edge.left - left) / w) * this.map.x.length),
      j = Math.floor(((top + h - (event.clientY - edge.top)) / h) * this.map.y.length);
    return i >= 0 && j >= 0 && i < this.map.x.length && j < this.map.y.length ? [i, j] : null;
  }

  /**
   * The cell of what was found.
   * @returns {Point}
   */
  nearest() {
    const { x, y, chosen } = this.map;
    return [nearestOf(x, chosen[0]), nearestOf(y, chosen[1])];
  }

  /* -- painting ------------------------------------------------------------------------------------------------- */

  paint() {
    const { map, pen, canvas } = this;
    if (!map) return;
    const { width, height, colour } = fitted(/** @type {any} */ (canvas), pen);
    if (!width || !height) return;
    const box = {
      left: MARGIN.left,
      top: MARGIN.top,
      w: width - MARGIN.left - MARGIN.right,
      h: height - MARGIN.top - MARGIN.bottom,
    };
    this.box = box;
    const columns = map.x.length,
      rows = map.y.length,
      cx = (/** @type {number} */ i) => box.left + ((i + 0.5) / columns) * box.w,
      cy = (/** @type {number} */ j) => box.top + box.h - ((j + 0.5) / rows) * box.h,
      shades = SHADES.map((name) => rgb(colour(name)));
    for (let j = 0; j < rows; j++)
      for (let i = 0; i < columns; i++) {
        const lost = map.lost[j][i];
        pen.fillStyle = lost === null ? colour("--line") : shade(shades, lost);
        const left = Math.floor(box.left + (i / columns) * box.w),
          top = Math.floor(box.top + box.h - ((j + 1) / rows) * box.h);
        pen.fillRect(
          left,
          top,
          Math.ceil(box.left + ((i + 1) / columns) * box.w) - left,
          Math.ceil(box.top + box.h - (j / rows) * box.h) - top,
        );
      }
    this.contours(colour, cx, cy);
    this.axes(colour, cx, cy, box);
    this.star(colour, cx, cy);
    if (this.at) {
      const [i, j] = this.at;
      pen.strokeStyle = colour("--ink");
      pen.lineWidth = 2;
      pen.strokeRect(cx(i) - box.w / columns / 2, cy(j) - box.h / rows / 2, box.w / columns, box.h / rows);
    }
  }

  /**
   * @param {Colour} colour
   * @param {(i: number) => number} cx
   * @param {(j: number) => number} cy
   */
  contours(colour, cx, cy) {
    const { map, pen } = this,
      all = map.times.flat().filter((/** @type {number | null} */ time) => time !== null);
    const low = Math.min(...all),
      high = Math.max(...all);
    if (!(high > low)) return;
    pen.lineWidth = 1;
    pen.font = `11px ${colour("--mono")}`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    /** @type {[number, number, string][]} */
    const places = [];
    for (let k = 1; k <= LEVELS; k++) {
      const level = low * (high / low) ** (k / (LEVELS + 1)),
        found = segments(map.times, level);
      pen.strokeStyle = colour("--ink-2");
      pen.beginPath();
      for (const [[a, b], [c, d]] of found) {
        pen.moveTo(cx(a), cy(b));
        pen.lineTo(cx(c), cy(d));
      }
      pen.stroke();
      if (found.length > 3) {
        const [[a, b]] = found[Math.floor(found.length * 0.6)];
        places.push([cx(a), cy(b), `${+level.toPrecision(3)} s`]);
      }
    }
    pen.lineWidth = 3;
    pen.strokeStyle = colour("--panel");
    pen.fillStyle = colour("--ink");
    /** @type {Point[]} */
    const taken = [];
    for (const [x, y, text] of places) {
      if (taken.some(([a, b]) => Math.abs(a - x) < 52 && Math.abs(b - y) < 14)) continue;
      taken.push([x, y]);
      pen.strokeText(text, x, y);
      pen.fillText(text, x, y);
    }
  }

  /**
   * @param {Colour} colour
   * @param {(i: number) => number} cx
   * @param {(j: number) => number} cy
   * @param {any} box
   */
  axes(colour, cx, cy, box) {
    const { map, pen } = this;
    pen.fillStyle = colour("--ink-2");
    pen.font = `11px ${colour("--mono")}`;
    pen.textAlign = "center";
    pen.textBaseline = "top";
    let right = -Infinity;
    map.x.forEach((/** @type {number} */ value, /** @type {number} */ i) => {
      const text = showNumber(value),
        half = pen.measureText(text).width / 2;
      if (cx(i) - half < right + 10 || cx(i) + half > box.left + box.w + 12) return;
      right = cx(i) + half;
      pen.fillText(text, cx(i), box.top + box.h + 5);
    });
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    let last = Infinity;
    map.y.forEach((/** @type {number} */ value, /** @type {number} */ j) => {
      if (cy(j) > last - 16) return;
      last = cy(j);
      pen.fillText(showNumber(value), box.left - 6, cy(j));
    });
    pen.textAlign = "right";
    pen.textBaseline = "bottom";
    pen.fillText(map.labels[0], box.left + box.w, box.top + box.h + MARGIN.bottom - 3, box.w + box.left - 8);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    const shades = SHADES.map((name) => rgb(colour(name))),
      wide = Math.min(90, box.w / 4),
      begin = box.left + box.w - wide - 36;
    pen.fillText(map.labels[1], 8, 12, begin - 60);
    for (let k = 0; k < wide; k++) {
      pen.fillStyle = shade(shades, k / wide);
      pen.fillRect(begin + k, 6, 1.5, 11);
    }
    pen.fillStyle = colour("--ink-2");
    pen.fillText("100 %", begin + wide + 4, 12);
    pen.textAlign = "right";
    pen.fillText("lost 0", begin - 4, 12);
  }

  /**
   * @param {Colour} colour
   * @param {(i: number) => number} cx
   * @param {(j: number) => number} cy
   */
  star(colour, cx, cy) {
    const { map, pen } = this,
      x = cx(between(map.x, map.chosen[0])),
      y = cy(between(map.y, map.chosen[1]));
    pen.beginPath();
    for (let k = 0; k < 10; k++) {
      const angle = (Math.PI / 5) * k - Math.PI / 2,
        long = k % 2 ? 4.5 : 11;
      pen.lineTo(x + long * Math.cos(angle), y + long * Math.sin(angle));
    }
    pen.closePath();
    pen.fillStyle = colour("--trace-1");
    pen.strokeStyle = colour("--panel");
    pen.lineWidth = 2;
    pen.stroke();
    pen.fill();
  }
}
