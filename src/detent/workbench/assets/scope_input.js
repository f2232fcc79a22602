/* Input at the scope's plot: wheel, drag, pinch and keys become changes of the view and of the cursors.

   Drag the plot to pan, the time axis to choose a range; the wheel zooms about the pointer, with Shift it pans; two
   fingers zoom; a double click shows everything. The keys are in KEYS. `scope` has view, cursors, plot and the calls
   look(view), moveCursor(index, at), select(from, to), follow(), fit(). */

/** @type {Record<string, number>} */
const GRAB = { mouse: 7, pen: 12, touch: 22 }; // px from a cursor's line
const ZOOM = 1.25;
const TAP = 5; // px that a pointer may move in a tap

export const KEYS = "arrows pan and zoom, f follows, 0 shows everything, a and b place the cursors, Esc removes them";

export class ScopeInput {
  /**
   * @param {HTMLElement} place
   * @param {import("./scope.js").Scope} scope
   */
  constructor(place, scope) {
    this.place = place;
    this.scope = scope;
    /** @type {Map<number, number>} which pointer, where */
    this.pointers = new Map();
    /** @type {any} of the `kind` pan, range, cursor or pinch */
    this.drag = null;
    /** @type {number | null} */
    this.hover = null;
    place.addEventListener("pointerdown", (event) => this.pointerdown(event));
    place.addEventListener("pointermove", (event) => this.pointermove(event));
    place.addEventListener("pointerup", (event) => this.pointerup(event));
    place.addEventListener("pointercancel", (event) => this.pointercancel(event));
    place.addEventListener("pointerleave", () => this.pointerleave());
    place.addEventListener("dblclick", () => this.dblclick());
    place.addEventListener("keydown", (event) => this.keydown(event));
    place.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  /** @param {MouseEvent} event */
  at(event) {
    const box = this.place.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  /** @param {PointerEvent} event */
  pointerdown(event) {
    if (event.button) return;
    const { x, y } = this.at(event);
    const { scope } = this;
    this.place.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, x);
    if (this.pointers.size === 2) {
      this.drag = { kind: "pinch", view: scope.view, from: [...this.pointers.values()] };
      scope.select(null);
      return;
    }
    const reach = GRAB[event.pointerType] || GRAB.mouse;
    const cursor = scope.cursors.findIndex((at) => at !== null && Math.abs(scope.plot.x(scope.view, at) - x) <= reach);
    if (cursor >= 0) this.drag = { kind: "cursor", index: cursor };
    else if (y < scope.plot.ruler) this.drag = { kind: "range", from: x };
    else this.drag = { kind: "pan", from: x, view: scope.view, moved: false };
  }

  /** @param {PointerEvent} event */
  pointermove(event) {
    const { x, y } = this.at(event);
    const { scope, drag } = this;
    this.hover = x;
    if (this.pointers.has(event.pointerId)) this.pointers.set(event.pointerId, x);
    if (!drag) {
      const near = scope.cursors.some((at) => at !== null && Math.abs(scope.plot.x(scope.view, at) - x) <= GRAB.mouse);
      this.place.style.cursor = near ? "ew-resize" : y < scope.plot.ruler ? "crosshair" : "grab";
    } else if (drag.kind === "cursor") {
      scope.moveCursor(drag.index, scope.plot.t(scope.view, Math.min(Math.max(x, 0), scope.plot.width)));
    } else if (drag.kind === "range") {
      scope.select([drag.from, x]);
    } else if (drag.kind === "pan") {
      drag.moved ||= Math.abs(x - drag.from) > TAP;
      if (!drag.moved) return;
      this.place.style.cursor = "grabbing";
      const by = ((drag.from - x) / scope.plot.width) * (drag.view.end - drag.view.begin);
      scope.look({ begin: drag.view.begin + by, end: drag.view.end + by });
    } else if (drag.kind === "pinch" && this.pointers.size === 2) {
      const [a, b] = drag.from.map((/** @type {number} */ from) => scope.plot.t(drag.view, from));
      const [xa, xb] = [...this.pointers.values()];
      if (Math.abs(xb - xa) < 8) return;
      const perPixel = (b - a) / (xb - xa);
      if (perPixel <= 0) return;
      scope.look({ begin: a - xa * perPixel, end: a + (scope.plot.width - xa) * perPixel });
    }
  }

  /** @param {PointerEvent} event */
  pointerup(event) {
    const { drag, scope } = this;
    const { x } = this.at(event);
    this.pointers.delete(event.pointerId);
    if (this.pointers.size) return;
    this.drag = null;
    if (drag && drag.kind === "range") {
      scope.select(null);
      const [from, to] = [drag.from, x].sort((a, b) => a - b);
      if (to - from > TAP) scope.look({ begin: scope.plot.t(scope.view, from), end: scope.plot.t(scope.view, to) });
    }
  }

  /** @param {PointerEvent} event */
  pointercancel(event) {
    this.pointers.delete(event.pointerId);
    this.drag = null;
    this.scope.select(null);
  }

  pointerleave() {
    this.hover = null;
  }

  dblclick() {
    this.scope.fit();
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const sideways = Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (event.shiftKey || sideways) {
      this.pan((sideways ? event.deltaX : event.deltaY) / 600);
      return;
    }
    this.zoom(ZOOM ** Math.max(-4, Math.min(4, event.deltaY / 80)), this.at(event).x);
  }

  /**
   * Move the view by a part of its width.
   * @param {number} part
   */
  pan(part) {
    const { view } = this.scope,
      by = part * (view.end - view.begin);
    this.scope.look({ begin: view.begin + by, end: view.end + by });
  }

  /**
   * Show `times` as much around the place x (null: in following the right edge, else the middle).
   * @param {number} times
   * @param {number | null} x
   */
  zoom(times, x = null) {
    const { scope } = this,
      { view } = scope;
    if (scope.following) {
      scope.spread((view.end - view.begin) * times);
      return;
    }
    const fixed = x === null ? (view.begin + view.end) / 2 : scope.plot.t(view, x);
    scope.look({ begin: fixed - (fixed - view.begin) * times, end: fixed + (view.end - fixed) * times });
  }

  /** @param {KeyboardEvent} event */
  keydown(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const place = () => {
      const { view, plot } = this.scope;
      return plot.t(view, this.hover === null ? plot.width / 2 : this.hover);
    };
    /** @type {Record<string, () => void>} */
    const actions = {
      ArrowLeft: () => this.pan(-0.15),
      ArrowRight: () => this.pan(0.15),
      ArrowUp: () => this.zoom(1 / ZOOM),
      ArrowDown: () => this.zoom(ZOOM),
      "+": () => this.zoom(1 / ZOOM),
      "-": () => this.zoom(ZOOM),
      f: () => this.scope.follow(),
      0: () => this.scope.fit(),
      a: () => this.scope.moveCursor(0, place()),
      b: () => this.scope.moveCursor(1, place()),
      Escape: () => this.scope.dropCursors(),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  }
}
