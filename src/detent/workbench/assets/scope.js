/* The Scope page: puts plot, hands, tools and feed together. Several windows have each their own view. */

import { element } from "./elements.js";
import { Feed } from "./scope_feed.js";
import { ScopeInput, KEYS } from "./scope_input.js";
import { Plot, showTime } from "./scope_plot.js";
import { Tools } from "./scope_tools.js";

const LEAST_SPAN = 20,
  MOST_SPAN = 400 * 86400e9; // ns of a view
const FIRST_SPAN = 4e9;

export class Scope {
  /** @param {Part} root */
  constructor(root) {
    this.root = root;
    this.view = { begin: -FIRST_SPAN, end: 0 };
    this.following = true;
    /** @type {[number | null, number | null]} */
    this.cursors = [null, null];
    /** @type {any} the trigger, since when */
    this.armed = null;
    /** @type {Frame | null} */
    this.frame = null;
    /** @type {Record<string, [any, any]>} */
    this.values = {};
    /** @type {Trace[]} */
    this.catalogue = [];
    /** @type {string[]} ids, once the catalogue is known */
    this.shown = [];
    this.known = false; // the catalogue
    /** @type {Point | null} */
    this.selection = null;
    this.cell = "";
    this.due = 0; // the frame that is asked for
    this.acknowledges = false;
    const tools = element("div", { class: "scope-tools" });
    this.strip = element("div", { class: "scope-strip", hidden: true, "aria-live": "off" });
    this.lanes = element("ol", { class: "scope-lanes" });
    const canvas = element("canvas", {
      tabindex: "0",
      role: "img",
      "aria-label": `Traces of the cell over time: ${KEYS}`,
    });
    this.empty = element(
      "p",
      { class: "scope-empty quiet", hidden: true },
      "No trace is shown. Choose some under Traces.",
    );
    this.place = element(
      "div",
      { class: "scope-place" },
      this.lanes,
      element("div", { class: "scope-canvas" }, canvas),
      this.empty,
    );
    root.replaceChildren(tools, this.strip, this.place);
    this.plot = new Plot(canvas);
    this.input = new ScopeInput(canvas, this);
    this.tools = new Tools(tools, this);
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    this.feed = new Feed(`${scheme}//${location.host}${root.dataset.feed}`, {
      onFrame: (frame) => this.take(frame),
      onNews: (news) => this.hear(news),
      onFile: (file) => this.keep(file),
      onState: (open) => root.toggleAttribute("data-waiting", !open),
    });
    this.watcher = new ResizeObserver(() => this.arrange());
    this.watcher.observe(this.place);
    this.unTheme = detent.onTheme(() => {
      this.plot.restyle();
      this.paint();
    });
    this.plot.restyle();
    root.scope = this; // for tests and for the curious
  }

  close() {
    this.feed.close();
    this.tools.close();
    this.watcher.disconnect();
    if (typeof this.unTheme === "function") this.unTheme();
  }

  /* -- what the feed brings -------------------------------------------------------------------------------- */

  /** @param {any} news */
  hear(news) {
    if (news.traces) {
      this.catalogue = news.traces;
      const known = new Set(this.catalogue.map((trace) => trace.id));
      if (news.cell !== this.cell) {
        this.shown = remembered(news.cell) || news.first;
        this.cursors = [null, null];
        this.following = true;
      }
      this.cell = news.cell;
      this.known = true;
      this.shown = this.shown.filter((/** @type {string} */ id) => known.has(id));
      if (!this.shown.length) this.shown = news.first;
      this.tools.offer(this.catalogue, this.shown);
      this.arrange();
    }
    if (news.found !== undefined) {
      this.tools.say(news.found === null ? "none that way" : `at ${showTime(news.found, 1000)}`);
      if (news.found !== null) this.put(news.found);
    }
    if (news.error) detent.toast(news.error, "error");
  }

  /** @param {Frame} frame */
  take(frame) {
    this.frame = frame;
    this.values = Object.fromEntries(frame.traces.map((trace) => [trace.id, trace.values]));
    if (this.following) {
      if (!(this.armed && frame.trigger === null)) this.view = { begin: frame.from, end: frame.to };
      if (this.armed) this.tools.say(frame.trigger === null ? "waits" : `at ${showTime(frame.trigger, 1000)}`);
      if (this.armed && this.armed.mode === "single" && frame.trigger !== null && frame.trigger > this.armed.since) {
        this.tools.disarm();
        this.armed = null;
        this.following = false;
        this.ask();
      }
    }
    this.paint(true);
  }

  /** @param {{file: string, bytes: BlobPart}} kept */
  keep({ file, bytes }) {
    const link = element("a", { href: URL.createObjectURL(new Blob([bytes])), download: file });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  /* -- the view ------------------------------------------------------------------------------------------- */

  /**
   * Show from begin to end, and no longer follow the present.
   * @param {View} view
   */
  look({ begin, end }) {
    const span = Math.min(Math.max(end - begin, LEAST_SPAN), MOST_SPAN);
    if (span !== end - begin) [begin, end] = [(begin + end - span) / 2, (begin + end + span) / 2];
    this.following = false;
    this.view = { begin, end };
    this.changed();
  }

  /**
   * Go on following, with so much time in the view.
   * @param {number} span
   */
  spread(span) {
    span = Math.min(Math.max(span, LEAST_SPAN), MOST_SPAN);
    this.view = { begin: this.view.end - span, end: this.view.end };
    this.changed();
  }

  follow() {
    this.following = !this.following;
    this.changed();
  }

  /* The whole history, for good. */
  fit() {
    if (this.frame) this.look({ begin: this.frame.first, end: Math.max(this.frame.now, this.frame.first + 1000) });
  }

  /**
   * Bring an instant to the quarter of the view.
   * @param {number} at
   */
  put(at) {
    const span = this.view.end - this.view.begin;
    this.look({ begin: at - span / 4, end: at + (3 * span) / 4 });
  }

  /** @param {Point | null} range */
  select(range) {
    this.selection = range;
    this.paint();
  }

  /**
   * @param {number} index
   * @param {number} at
   */
  moveCursor(index, at) {
    this.cursors[index] = Math.round(at);
    this.changed();
  }

  dropCursors() {
    this.cursors = [null, null];
    this.changed();
  }

  toggleCursors() {
    const span = this.view.end - this.view.begin;
    if (this.cursors.some((at) => at !== null)) this.dropCursors();
    else {
      this.following = false;
      this.cursors = [Math.round(this.view.begin + span / 3), Math.round(this.view.begin + (2 * span) / 3)];
      this.changed();
    }
  }

  /** @param {any} trigger */
  arm(trigger) {
    this.armed = trigger && { ...trigger, since: this.frame ? this.frame.now : 0 };
    if (trigger) this.following = true;
    if (this.catalogue.length) this.changed();
  }

  /** @param {number} direction */
  find(direction) {
    const span = this.view.end - this.view.begin;
    const from = this.following ? this.view.end : this.view.begin + span / 4;
    this.feed.say({ find: { ...this.tools.set, from: Math.round(from), direction } });
  }

  /**
   * @param {string} id
   * @param {boolean} on
   */
  show(id, on) {
    this.shown = this.catalogue
      .map((trace) => trace.id)
      .filter((other) => (other === id ? on : this.shown.includes(other)));
    detent.remember(`scope.${this.cell}`, JSON.stringify(this.shown));
    this.tools.tick(this.shown);
    this.arrange();
  }

  /** @param {string} kind */
  save(kind) {
    if (kind !== "png") {
      this.feed.say({
        export: { kind, traces: this.shown, begin: Math.round(this.view.begin), end: Math.round(this.view.end) },
      });
      return;
    }
    this.picture().toBlob(
      async (blob) => blob && this.keep({ file: "scope.png", bytes: await blob.arrayBuffer() }),
      "image/png",
    );
  }

  /* What is seen, with the labels, as a canvas. */
  picture() {
    const { canvas } = this.plot,
      ratio = canvas.width / this.plot.width;
    const left = Math.round(190 * ratio),
      copy = element("canvas");
    copy.width = canvas.width + left;
    copy.height = canvas.height;
    const pen = /** @type {CanvasRenderingContext2D} */ (copy.getContext("2d"));
    pen.fillStyle = this.plot.colours.ground;
    pen.fillRect(0, 0, copy.width, copy.height);
    pen.drawImage(canvas, left, 0);
    pen.scale(ratio, ratio);
    for (const lane of this.plot.lanes)
      lane.traces.forEach((trace, k) => {
        const y = lane.level ? lane.top + lane.height / 2 : lane.top + 16 + 16 * k;
        pen.fillStyle = this.plot.inks[trace.index % 8];
        pen.fillRect(10, y - 1, 12, 3);
        pen.fillStyle = this.plot.colours.ink;
        pen.font = this.plot.font;
        pen.textBaseline = "middle";
        const units = trace.units && !trace.level ? `, ${trace.units}` : "";
        pen.fillText(`${trace.unit} ${trace.name}${units}`, 28, y, 155);
      });
    return copy;
  }

  /* -- painting --------------------------------------------------------------------------------------------- */

  arrange() {
    if (!this.known || !this.place.isConnected) return;
    const byId = new Map(this.catalogue.map((trace) => [trace.id, trace]));
    const traces = this.shown.flatMap((id) => byId.get(id) ?? []);
    this.plot.ruler = matchMedia("(pointer: coarse)").matches ? 38 : 28;
    const { clientWidth } = /** @type {Part} */ (this.plot.canvas.parentElement);
    this.plot.arrange(traces, clientWidth, this.place.clientHeight);
    this.plot.resize(clientWidth);
    this.lanes.style.height = `${this.plot.height}px`;
    this.empty.hidden = traces.length > 0;
    this.tools.label(this.lanes, this.plot);
    this.changed();
  }

  changed() {
    this.ask();
    this.paint();
  }

  ask() {
    if (!this.known) return;
    const { view, following, armed } = this;
    this.feed.ask({
      traces: this.shown,
      points: Math.max(Math.round(this.plot.width), 100),
      follow: following,
      trigger: following ? armed : null,
      begin: Math.round(view.begin),
      end: Math.round(view.end),
      cursors: this.cursors,
    });
  }

  paint(acknowledge = false) {
    this.acknowledges ||= acknowledge;
    if (this.due) return;
    this.due = requestAnimationFrame(() => {
      this.due = 0;
      if (this.acknowledges) {
        this.acknowledges = false;
        this.feed.painted();
        this.root.dataset.frames = this.plot.painted + 1;
      }
      this.plot.paint(this.view, this.frame, this.cursors, this.selection);
      if (!this.tools.byId.size) return;
      this.tools.read(this.lanes, this.values, this.cursors, this.view, this.following);
      this.tools.differ(this.strip, this.cursors, this.view);
    });
  }
}

/** @param {string} cell */
function remembered(cell) {
  try {
    return JSON.parse(detent.remembered(`scope.${cell}`) || "null");
  } catch {
    return null;
  }
}

detent.part("scope", (root) => {
  const scope = new Scope(root);
  return () => scope.close();
});
