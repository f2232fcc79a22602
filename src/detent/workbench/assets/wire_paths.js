// The paths of wires: their corners, and where they have room. Knows no page.

const ROUND = 6; // px, of the corners

/**
 * A path through points with right angles, its corners rounded.
 * @param {[number, number][]} points
 */
export function rounded(points) {
  let path = `M${points[0][0]} ${points[0][1]}`;
  for (let n = 1; n < points.length - 1; n += 1) {
    const [[ax, ay], [bx, by], [cx, cy]] = [points[n - 1], points[n], points[n + 1]];
    const into = Math.hypot(bx - ax, by - ay);
    const out = Math.hypot(cx - bx, cy - by);
    const r = Math.min(ROUND, into / 2, out / 2);
    if (r < 0.5) {
      path += `L${bx} ${by}`;
      continue;
    }
    path += `L${bx + ((ax - bx) / into) * r} ${by + ((ay - by) / into) * r}`;
    path += `Q${bx} ${by} ${bx + ((cx - bx) / out) * r} ${by + ((cy - by) / out) * r}`;
  }
  const last = points[points.length - 1];
  return `${path}L${last[0]} ${last[1]}`;
}

/**
 * Heights at which a wire can run from x1 to x2 without touching a panel, from [top to bottom].
 * @param {{left: number, right: number, top: number, bottom: number}[]} cards
 * @param {number} x1
 * @param {number} x2
 * @param {number} height of what the wires are drawn on
 * @returns {[number, number][]}
 */
export function passages(cards, x1, x2, height) {
  const inWay = cards.filter((card) => card.right > Math.min(x1, x2) && card.left < Math.max(x1, x2));
  const spans = inWay.map((card) => [card.top, card.bottom]).sort((a, b) => a[0] - b[0]);
  /** @type {[number, number][]} */
  const free = [];
  let low = 0;
  for (const [top, bottom] of spans) {
    if (top - low > 6) free.push([low, top]);
    low = Math.max(low, bottom);
  }
  free.push([low, Math.max(height, low + 20)]);
  return free;
}
