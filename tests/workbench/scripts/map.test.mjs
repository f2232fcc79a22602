import assert from "node:assert/strict";
import { test } from "node:test";

import { between, nearestOf, segments, shade } from "./assets/contours.js";

test("a line of equal values runs between the cells that are on either side of it", () => {
  assert.deepEqual(segments([[0, 2], [0, 2]], 1), [[[0.5, 0], [0.5, 1]]]);
  assert.deepEqual(segments([[0, 0], [4, 4]], 1), [[[1, 0.25], [0, 0.25]]]);
  assert.deepEqual(segments([[0, 0], [0, 0]], 1), []);
});

test("a saddle has two pieces, and where nothing is known there is none", () => {
  assert.equal(segments([[0, 2], [2, 0]], 1).length, 2);
  assert.deepEqual(segments([[0, null], [0, 2]], 1), []);
});

test("the nearest value, and where between the values another one is", () => {
  assert.equal(nearestOf([100, 200, 400], 290), 1);
  assert.equal(nearestOf([100, 200, 400], 310), 2);
  assert.equal(between([100, 200, 400], 100), 0);
  assert.ok(Math.abs(between([100, 200, 400], Math.sqrt(2) * 200) - 1.5) < 1e-9);
  assert.equal(between([100, 200, 400], 900), 2);
});

test("a part is a colour between its neighbours", () => {
  const shades = [[0, 0, 0], [100, 100, 100], [200, 0, 0]];
  assert.equal(shade(shades, 0), "rgb(0,0,0)");
  assert.equal(shade(shades, 0.25), "rgb(50,50,50)");
  assert.equal(shade(shades, 1), "rgb(200,0,0)");
  assert.equal(shade(shades, 7), "rgb(200,0,0)");
});
