// The wires of a cell, drawn between the jacks of its panels: along the gaps between them, never across one.

import { passages, rounded } from "./wire_paths.js";

const { part, on } = window.detent;

const OUTSIDE = 46; // px beside the outermost panels, at most
const NS = "http://www.w3.org/2000/svg";

/**
 * The panels in `box`, and the gaps: columns between them as [left, right].
 * @param {Part} box
 * @param {DOMRect} frame
 */
function gaps(box, frame) {
  const cards = [...box.querySelectorAll(".panel")].map((card) => {
    const at = card.getBoundingClientRect();
    const [left, right] = [at.left - frame.left, at.right - frame.left];
    return { card, left, right, top: at.top - frame.top, bottom: at.bottom - frame.top, column: 0 };
  });
  const lefts = [...new Set(cards.map((card) => Math.round(card.left)))].sort((a, b) => a - b);
  const columns = lefts.map((left) => {
    const mine = cards.filter((card) => Math.round(card.left) === left);
    return { left, right: Math.max(...mine.map((card) => card.right)) };
  });
  const last = columns[columns.length - 1].right;
  /** @type {Point[]} */
  const between = columns.map((column, n) => [n ? columns[n - 1].right : Math.max(0, column.left - OUTSIDE), column.left]);
  between.push([last, Math.min(frame.width, last + OUTSIDE)]);
  for (const one of cards) one.column = lefts.indexOf(Math.round(one.left));
  return { cards, between };
}

part("wires", (box) => {
  const svg = box.querySelector("svg.wires");
  /** @type {[string, string[]][]} */
  const wires = JSON.parse(box.dataset.wires);
  /** @type {End[]} */
  let ends = [];
  let planned = 0;

  /** @param {string} name */
  function jack(name) {
    const element = box.querySelector(`[data-jack="${CSS.escape(name)}"]`);
    if (!element) return null;
    const dot = element.querySelector(".jack").getBoundingClientRect();
    return { element, card: element.closest(".panel"), side: element.dataset.side, dot };
  }

  function draw() {
    planned = 0;
    const frame = box.getBoundingClientRect();
    if (!frame.width) return;
    const { cards, between } = gaps(box, frame);
    /** @param {any} end */
    const place = (end) => {
      const column = cards.find((one) => one.card === end.card)?.column ?? 0;
      const gap = end.side === "left" ? column : column + 1;
      return { x: end.dot.left + end.dot.width / 2 - frame.left, y: end.dot.top + end.dot.height / 2 - frame.top, gap };
    };
    // which wire uses which gaps
    /** @type {{wire: number, a: {x: number, y: number, gap: number}, b: {x: number, y: number, gap: number}, passage: Point | null}[]} */
    const routes = [];
    const users = new Map(); // gap or passage -> the wires in it, in order
    /**
     * @param {any} key
     * @param {number} wire
     */
    const use = (key, wire) => {
      if (!users.has(key)) users.set(key, []);
      if (!users.get(key).includes(wire)) users.get(key).push(wire);
    };
    wires.forEach(([source, targets], wire) => {
      const from = jack(source);
      if (!from) return;
      const a = place(from);
      for (const target of targets) {
        const to = jack(target);
        if (!to) continue;
        const b = place(to);
        use(a.gap, wire);
        use(b.gap, wire);
        /** @type {Point | null} */
        let passage = null;
        if (a.gap !== b.gap) {
          /** @param {number} gap */
          const middle = (gap) => (between[gap][0] + between[gap][1]) / 2;
          const free = passages(cards, middle(a.gap), middle(b.gap), frame.height);
          const far = (/** @type {Point} */ [low, high]) => {
            const y = (low + high) / 2;
            return Math.abs(a.y - y) + Math.abs(b.y - y);
          };
          passage = free.reduce((best, one) => (far(one) < far(best) ? one : best));
          use(`${Math.round(passage[0])}`, wire);
        }
        routes.push({ wire, a, b, passage });
      }
    });
    /**
     * @param {any} key
     * @param {number} wire
     * @param {number} low
     * @param {number} high
     * @param {number} widest
     */
    const lane = (key, wire, low, high, widest) => {
      const all = users.get(key);
      const step = Math.min(widest, (high - low) / (all.length + 1));
      return (low + high) / 2 + (all.indexOf(wire) - (all.length - 1) / 2) * step;
    };
    for (const end of ends) end();
    ends = [];
    svg.replaceChildren();
    const groups = new Map();
    for (const { wire, a, b, passage } of routes) {
      const x1 = lane(a.gap, wire, ...between[a.gap], 9);
      const x2 = lane(b.gap, wire, ...between[b.gap], 9);
      const points = [[a.x, a.y], [x1, a.y]];
      if (passage) {
        const low = passage[0];
        const high = Math.min(passage[1], low + 34);
        const y = lane(`${Math.round(low)}`, wire, passage[1] - low > 60 && low > 0 ? low : passage[1] - (high - low), passage[1] - low > 60 && low > 0 ? high : passage[1], 7);
        points.push([x1, y], [x2, y]);
      }
      points.push([x2, b.y], [b.x, b.y]);
      if (!groups.has(wire)) groups.set(wire, document.createElementNS(NS, "g"));
      const d = rounded(points.map(([x, y]) => [Math.round(x * 2) / 2, Math.round(y * 2) / 2]));
      for (const kind of ["halo", "line"]) {
        const path = document.createElementNS(NS, "path");
        path.setAttribute("class", kind);
        path.setAttribute("d", d);
        groups.get(wire).append(path);
      }
    }
    for (const [wire, group] of groups) {
      svg.append(group);
      const [source, targets] = wires[wire];
      for (const end of [source, ...targets]) {
        const key = keyOf(end);
        if (!key) continue;
        ends.push(on(key, (changed, value) => {
          if (changed === key) group.dataset.value = value === null ? "" : String(value);
        }));
        break;
      }
      group.dataset.wire = source;
    }
  }

  /**
   * The key of the level at an end of a wire: a switch's, or a pin's. A motor's pins tell none.
   * @param {string} end
   */
  function keyOf(end) {
    const dot = end.indexOf(".");
    if (dot < 0) return `s.${end}.level`;
    const pin = box.querySelector(`[data-jack="${CSS.escape(end)}"]`);
    return pin && pin.dataset.level ? pin.dataset.level : null;
  }

  function plan() {
    if (!planned) planned = requestAnimationFrame(draw);
  }

  /** @param {any} event */
  const light = (event) => {
    const element = event.target.closest("[data-jack]");
    const name = element && element.dataset.jack;
    for (const group of /** @type {Iterable<SVGElement>} */ (svg.children)) {
      const [source, targets] = wires.find(([from]) => from === group.dataset.wire) || ["", []];
      group.classList.toggle("lit", Boolean(name) && (source === name || targets.includes(name)));
    }
  };
  box.addEventListener("pointerover", light);
  box.addEventListener("focusin", light);
  const resized = new ResizeObserver(plan);
  resized.observe(box);
  for (const card of box.querySelectorAll(".panel")) resized.observe(card);
  plan();
  return () => {
    resized.disconnect();
    for (const end of ends) end();
  };
});
