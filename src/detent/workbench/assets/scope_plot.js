/* The plot of the scope: lanes of traces over one time axis, painted on a canvas.

   It knows no server and no hands. Times are ns of the cell as numbers (exact to 2^53 ns, 104 days); a view is
   {begin, end}; a frame is what the feed sent (see scope_feed.js): columns, of each the least and the greatest value,
   so that no pulse is lost; NaN is a gap. A trace has one of two shapes: "line" runs straight from column to column,
   "step" holds its value. */

const LEVEL_HEIGHT = 34,
  LEAST_HEIGHT = 84; // of lanes, px
const HEADED = 16; // px more in a narrow plot, where labels stand on the lanes
const NARROW = 500;
const TICK_ROOM = 118; // between two labels of the time axis, px
const PADDING = 0.08; // of a lane's range above and below
const SHRINK = 0.55; // a range is kept until the values fill no more than this

export class Plot {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.ruler = 28;
    /** @type {Lane[]} */
    this.lanes = [];
    /** @type {Record<string, string>} */
    this.colours = {};
    /** @type {string[]} of the traces */
    this.inks = [];
    this.font = "11px monospace";
    this.head = 0; // px more in a lane that has its labels on it
    this.width = this.height = 0; // of the plot; right of it is the margin with the values
    this.margin = 0;
    this.painted = 0; // frames
  }

  /* Take the colours from the style sheet. Call it again when the theme changes. */
  restyle() {
    const style = getComputedStyle(this.canvas);
    /** @param {string} name */
    const value = (name) => style.getPropertyValue(name).trim();
    this.colours = {
      ink: value("--scope-ink"),
      dim: value("--scope-dim"),
      grid: value("--scope-grid"),
      ground: value("--scope-ground"),
      edge: value("--scope-edge"),
      mark: value("--scope-mark"),
      cursor: value("--scope-cursor"),
      shade: value("--scope-shade"),
    };
    this.inks = [1, 2, 3, 4, 5, 6, 7, 8].map((n) => value(`--scope-trace-${n}`));
    this.font = `11px ${value("--scope-mono") || "monospace"}`;
  }

  /**
   * Lay the lanes out for these traces ({id, lane, shape, low, high}), and take the size of the canvas.
   * Traces of one `lane` share it. Returns the lanes.
   * @param {Trace[]} traces
   * @param {number} width
   * @param {number} room
   */
  arrange(traces, width, room) {
    this.head = width < NARROW ? HEADED : 0;
    const levelHeight = LEVEL_HEIGHT + this.head;
    const kept = new Map(this.lanes.map((lane) => [lane.name, lane]));
    const lanes = new Map();
    traces.forEach((trace, index) => {
      const lane = lanes.get(trace.lane) || { name: trace.lane, traces: [], level: trace.level };
      lane.traces.push({ ...trace, index });
      lanes.set(trace.lane, lane);
    });
    this.lanes = [...lanes.values()];
    const levels = this.lanes.filter((lane) => lane.level).length,
      curves = this.lanes.length - levels;
    const left = room - this.ruler - levels * levelHeight;
    const curve = curves ? Math.max(LEAST_HEIGHT, Math.floor(left / curves)) : 0;
    let top = this.ruler;
    for (const lane of this.lanes) {
      lane.top = top;
      lane.height = lane.level ? levelHeight : curve;
      const before = kept.get(lane.name);
      if (before) [lane.low, lane.high] = [before.low, before.high];
      top += lane.height;
    }
    this.height = Math.max(top, room);
    return this.lanes;
  }

  /**
   * Fit the canvas into its place.
   * @param {number} width
   */
  resize(width) {
    this.margin = width < NARROW ? 0 : 54;
    this.width = width - this.margin;
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(width * ratio), Math.round(this.height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) {
      this.canvas.width = w;
      this.canvas.height = h;
      this.canvas.style.height = `${this.height}px`;
    }
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  /**
   * @param {View} view
   * @param {number} t
   */
  x(view, t) {
    return ((t - view.begin) / (view.end - view.begin)) * this.width;
  }
  /**
   * @param {View} view
   * @param {number} x
   */
  t(view, x) {
    return view.begin + (x / this.width) * (view.end - view.begin);
  }

  /**
   * Paint everything: `frame` may be null, and need not cover the view.
   * @param {View} view
   * @param {Frame | null} frame
   * @param {(number | null)[]} cursors
   * @param {Point | null} selection
   */
  paint(view, frame, cursors, selection) {
    const { pen, colours } = this;
    pen.fillStyle = colours.ground;
    pen.fillRect(0, 0, this.width + this.margin, this.height);
    pen.font = this.font;
    this.axis(view);
    /** @type {Map<string, Columns>} */
    const data = new Map();
    for (const trace of frame ? frame.traces : []) data.set(trace.id, trace);
    for (const lane of this.lanes) {
      const present = lane.traces.flatMap((trace) => {
        const columns = data.get(trace.id);
        return columns ? [{ trace, columns }] : [];
      });
      this.range(lane, present.map(({ columns }) => columns), view, frame);
      this.frame(lane);
      if (!lane.level) this.scale(lane);
      pen.save();
      pen.beginPath();
      pen.rect(0, lane.top, this.width, lane.height);
      pen.clip();
      if (frame) for (const { trace, columns } of present) this.trace(view, frame, lane, trace, columns);
      pen.restore();
    }
    if (frame) this.marks(view, frame);
    if (selection) {
      pen.fillStyle = colours.shade;
      pen.fillRect(Math.min(...selection), 0, Math.abs(selection[1] - selection[0]), this.height);
    }
    cursors.forEach((at, index) => at !== null && this.cursor(view, at, "AB"[index]));
    this.painted += 1;
  }

  /** @param {View} view */
  axis(view) {
    const { pen, colours } = this;
    const step = niceStep((view.end - view.begin) / Math.max(this.width / TICK_ROOM, 1));
    pen.strokeStyle = colours.grid;
    pen.fillStyle = colours.dim;
    pen.lineWidth = 1;
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    pen.beginPath();
    for (let k = Math.ceil(view.begin / step); k * step <= view.end; k++) {
      const x = crisp(this.x(view, k * step));
      pen.moveTo(x, 4);
      pen.lineTo(x, this.height);
      if (k >= 0) pen.fillText(showTime(k * step, step), x + 5, this.ruler / 2 + 1);
    }
    pen.stroke();
    if (view.begin < 0) {
      // before the cell was made there is nothing
      pen.fillStyle = colours.grid;
      pen.fillRect(0, this.ruler, Math.min(this.x(view, 0), this.width), this.height);
    }
  }

  /**
   * @param {Lane} lane
   * @param {Columns[]} data
   * @param {View} view
   * @param {Frame | null} frame null where there is no data
   */
  range(lane, data, view, frame) {
    if (lane.level) {
      [lane.low, lane.high] = [0, 1];
      return;
    }
    let low = Infinity,
      high = -Infinity;
    for (const { base, low: lows, high: highs } of data) {
      if (!frame) break;
      const first = Math.max(Math.floor((view.begin - frame.begin) / frame.width), 0);
      const last = Math.min(Math.ceil((view.end - frame.begin) / frame.width), lows.length);
      for (let i = first; i < last; i++) {
        if (base + lows[i] < low) low = base + lows[i];
        if (base + highs[i] > high) high = base + highs[i];
      }
    }
    if (low > high) {
      if (lane.low === undefined) [lane.low, lane.high] = [0, 1];
      return;
    }
    if (low > 0 && low < 0.6 * high) low = 0;
    if (high < 0 && high > 0.6 * low) high = 0;
    const room = Math.max((high - low) * PADDING, Math.abs(high) * 1e-6, 1e-9);
    const span = lane.high - lane.low;
    const fits = low - room / 2 >= lane.low && high + room / 2 <= lane.high && high - low > SHRINK * span;
    if (!fits || !(span > 0)) [lane.low, lane.high] = high > low ? [low - room, high + room] : [low - 1, high + 1];
  }

  /**
   * The y of 0 and the px of 1, downwards, in a lane.
   * @param {Lane} lane
   */
  map(lane) {
    const inset = lane.level ? 9 : 3;
    const rise = -(lane.height - 2 * inset - this.head) / (lane.high - lane.low);
    return [lane.top + lane.height - inset - lane.low * rise, rise];
  }

  /**
   * @param {Lane} lane
   * @param {number} value
   */
  y(lane, value) {
    const [zero, rise] = this.map(lane);
    return zero + value * rise;
  }

  /** @param {Lane} lane */
  frame(lane) {
    const { pen, colours } = this;
    pen.strokeStyle = colours.edge;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(0, crisp(lane.top + lane.height));
    pen.lineTo(this.width + this.margin, crisp(lane.top + lane.height));
    pen.stroke();
  }

  /**
   * @param {View} view
   * @param {Frame} frame
   * @param {Lane} lane
   * @param {Trace & { index: number }} info
   * @param {Columns} data
   */
  trace(view, frame, lane, info, data) {
    const { pen } = this,
      { low, high } = data;
    const colour = this.inks[info.index % this.inks.length];
    const scale = (this.width / (view.end - view.begin)) * frame.width; // px of a column
    const shift = this.x(view, frame.begin);
    const [zero, rise] = this.map(lane),
      base = zero + data.base * rise;
    const first = Math.max(Math.floor(-shift / scale) - 1, 0);
    const last = Math.min(Math.ceil((this.width - shift) / scale) + 1, low.length);
    const holds = info.shape === "step";
    pen.strokeStyle = colour;
    pen.lineWidth = 1.5;
    pen.lineJoin = "round";
    pen.beginPath();
    let y = NaN; // to which the line has come; NaN: in a gap
    let flat = false; // whether it owes a stretch at y
    for (let i = first; i < last; i++) {
      if (low[i] !== low[i]) {
        if (flat) pen.lineTo(shift + i * scale, y);
        y = NaN;
        flat = false;
        continue;
      }
      const a = base + low[i] * rise,
        b = base + high[i] * rise;
      if (a === b) {
        if (a === y) {
          flat = true;
          continue;
        }
        if (y !== y) pen.moveTo(shift + i * scale, a);
        else if (holds || flat) pen.lineTo(shift + i * scale, y);
        pen.lineTo(shift + (holds ? i : i + 0.5) * scale, a);
        y = a;
        flat = holds;
      } else if (holds || y !== y) {
        // something happened within the column: through both ends, and on from the farther
        const middle = shift + (i + 0.5) * scale;
        if (flat || (holds && y === y)) pen.lineTo(middle, y);
        const down = Math.abs(y - b) < Math.abs(y - a);
        if (y !== y) pen.moveTo(middle, down ? b : a);
        else pen.lineTo(middle, down ? b : a);
        pen.lineTo(middle, down ? a : b);
        y = down ? a : b;
        flat = holds;
      } else {
        // a curve: from where it came in to the farther end, by way of the nearer if that is another
        if (flat) pen.lineTo(shift + i * scale, y);
        const [near, far] = Math.abs(y - b) < Math.abs(y - a) ? [b, a] : [a, b];
        if (Math.abs(y - near) > 0.5) pen.lineTo(shift + (i + 0.5) * scale, near);
        pen.lineTo(shift + (i + 1) * scale, far);
        y = far;
        flat = false;
      }
    }
    if (flat) pen.lineTo(shift + last * scale, y);
    pen.stroke();
    if (lane.level) this.fill(lane, colour, high, first, last, shift, scale);
  }

  /**
   * Where a level is high: a pale ground, so that lanes can be told at a glance.
   * @param {Lane} lane
   * @param {string} colour
   * @param {Float32Array} high
   * @param {number} first
   * @param {number} last
   * @param {number} shift
   * @param {number} scale
   */
  fill(lane, colour, high, first, last, shift, scale) {
    const { pen } = this;
    pen.fillStyle = colour;
    pen.globalAlpha = 0.14;
    const top = this.y(lane, 1),
      depth = this.y(lane, 0) - top;
    for (let i = first; i < last; i++) {
      if (high[i] !== 1) continue;
      const from = i;
      while (i + 1 < last && high[i + 1] === 1) i += 1;
      pen.fillRect(shift + from * scale, top, Math.max((i + 1 - from) * scale, 0.5), depth);
    }
    pen.globalAlpha = 1;
  }

  /**
   * Labels of a lane's values.
   * @param {Lane} lane
   */
  scale(lane) {
    const { pen, colours } = this;
    const step = niceStep((lane.high - lane.low) / Math.max(lane.height / 34, 2));
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let k = Math.ceil(lane.low / step); k * step <= lane.high; k++) {
      const y = this.y(lane, k * step);
      if (y < lane.top + 8 || y > lane.top + lane.height - 8) continue;
      const text = showNumber(k * step, step),
        right = this.width + Math.max(this.margin, 1) - 5;
      if (!this.margin) {
        // the values stand on the plot
        pen.fillStyle = colours.ground;
        pen.globalAlpha = 0.75;
        pen.fillRect(right - 4 - pen.measureText(text).width, y - 7, pen.measureText(text).width + 8, 14);
        pen.globalAlpha = 1;
      }
      pen.fillStyle = colours.dim;
      pen.fillText(text, right, y);
      pen.strokeStyle = colours.grid;
      pen.beginPath();
      pen.moveTo(0, crisp(y));
      pen.lineTo(this.width, crisp(y));
      pen.stroke();
    }
  }

  /**
   * The present, the trigger, and what happened beside the traces.
   * @param {View} view
   * @param {Frame} frame
   */
  marks(view, frame) {
    const { pen, colours } = this;
    /**
     * @param {number} at
     * @param {string} colour
     * @param {string} label
     * @param {number[]} dash
     */
    const upright = (at, colour, label, dash) => {
      const x = crisp(this.x(view, at));
      if (x < 0 || x > this.width) return;
      pen.strokeStyle = pen.fillStyle = colour;
      pen.setLineDash(dash);
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(x, this.ruler - 4);
      pen.lineTo(x, this.height);
      pen.stroke();
      pen.setLineDash([]);
      if (!label) return;
      pen.textAlign = "center";
      pen.fillText(label, x, this.ruler - 9);
    };
    if (frame.now < view.end) upright(frame.now, colours.dim, "", [2, 3]);
    if (frame.trigger !== null && frame.trigger !== undefined) upright(frame.trigger, colours.mark, "T", [6, 3]);
    for (const { at } of frame.marks || []) {
      const x = this.x(view, at);
      if (x < 0 || x > this.width) continue;
      pen.fillStyle = colours.mark;
      pen.beginPath();
      pen.moveTo(x - 4, this.ruler - 6);
      pen.lineTo(x + 4, this.ruler - 6);
      pen.lineTo(x, this.ruler);
      pen.fill();
    }
  }

  /**
   * @param {View} view
   * @param {number} at
   * @param {string} name
   */
  cursor(view, at, name) {
    const { pen, colours } = this;
    const x = crisp(this.x(view, at));
    pen.strokeStyle = pen.fillStyle = colours.cursor;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x, 0);
    pen.lineTo(x, this.height);
    pen.stroke();
    pen.fillRect(x - 9, 0, 18, 17);
    pen.fillStyle = colours.ground;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(name, x, 9);
  }
}

/** @param {number} x */
const crisp = (x) => Math.round(x) + 0.5;

/**
 * 1, 2 or 5 times a power of ten, not below `least`.
 * @param {number} least
 */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= least * 0.999999) || 10 * power;
}

/**
 * A time of the cell (ns) in seconds, with as many figures as a step of `step` ns needs.
 * @param {number} t
 * @param {number} step
 */
export function showTime(t, step) {
  const figures = Math.min(Math.max(Math.ceil(9 - Math.log10(Math.max(step, 1))), 0), 9);
  const [whole, part = ""] = (Math.round(t) / 1e9).toFixed(figures).split(".");
  return `${whole}${part && "." + part.replace(/(...)(?=.)/g, "$1\u2009")} s`;
}

/**
 * A length of time in ns, for people: 1.25 ms.
 * @param {number} ns
 */
export function showSpan(ns) {
  const size = Math.abs(ns);
  for (const [unit, of] of Object.entries({ s: 1e9, ms: 1e6, "\u00b5s": 1e3 }))
    if (size >= of) return `${+(ns / of).toPrecision(6)} ${unit}`;
  return `${Math.round(ns)} ns`;
}

/** @param {number} hertz */
export function showRate(hertz) {
  for (const [unit, of] of Object.entries({ MHz: 1e6, kHz: 1e3 }))
    if (hertz >= of) return `${+(hertz / of).toPrecision(5)} ${unit}`;
  return `${+hertz.toPrecision(5)} Hz`;
}

/**
 * A value, with the figures that a step of `step` needs (0: six figures).
 * @param {number} value
 */
export function showNumber(value, step = 0) {
  if (!step) return `${+value.toPrecision(6)}`.replace("-", "\u2212");
  const figures = Math.min(Math.max(-Math.floor(Math.log10(step) + 1e-9), 0), 9);
  return value
    .toFixed(figures)
    .replace(/^-(?=0(\.0*)?$)/, "")
    .replace("-", "\u2212");
}
