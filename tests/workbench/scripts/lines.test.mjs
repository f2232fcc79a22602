import assert from "node:assert/strict";
import { test } from "node:test";

import { bytes } from "./assets/typed_bytes.js";
import { passages, rounded } from "./assets/wire_paths.js";

test("escapes are bytes; everything else stands for itself", () => {
  assert.equal(bytes("F\\r"), "F\r");
  assert.equal(bytes("\\x1B\\n\\t"), "\x1b\n\t");
  assert.equal(bytes("\\\\r"), "\\r");
  assert.equal(bytes("\\q \\x1"), "\\q \\x1");
  assert.equal(bytes("\\xff"), "\u00ff");
});

test("a path goes through its points, with corners no larger than there is room", () => {
  assert.equal(rounded([[0, 0], [10, 0]]), "M0 0L10 0");
  assert.equal(rounded([[0, 0], [20, 0], [20, 20]]), "M0 0L14 0Q20 0 20 6L20 20");
  assert.equal(rounded([[0, 0], [4, 0], [4, 20]]), "M0 0L2 0Q4 0 4 2L4 20");
  assert.equal(rounded([[0, 0], [0, 0], [5, 0]]), "M0 0L0 0L5 0");
});

test("a wire passes between panels, and never across one", () => {
  const card = (left, top) => ({ left, right: left + 100, top, bottom: top + 50 });
  const cards = [card(0, 10), card(0, 100), card(200, 0)];
  assert.deepEqual(passages(cards, 20, 80, 200), [[0, 10], [60, 100], [150, 200]]);
  assert.deepEqual(passages(cards, 80, 20, 200), passages(cards, 20, 80, 200));
  assert.deepEqual(passages(cards, 120, 180, 200), [[0, 200]]);
  for (const [low, high] of passages(cards, 0, 300, 160))
    for (const { top, bottom } of cards) assert.ok(high <= top || low >= bottom, `${low} to ${high}`);
});
