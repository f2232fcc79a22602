import assert from "node:assert/strict";
import { test } from "node:test";

import { Silence } from "./assets/silence.js";

test("who speaks is not silent, and who does not is for as long as that lasts", () => {
  const silence = new Silence(3000, 0);
  for (let now = 1000; now <= 9000; now += 1000) {
    silence.heard(now - 10);
    assert.equal(silence.look(now), 0);
  }
  assert.deepEqual([10000, 11000, 12000, 13000].map((now) => silence.look(now)), [0, 0, 3010, 4010]);
  silence.heard(13500);
  assert.equal(silence.look(14000), 0);
});

test("a page that was asleep does not blame others: what came meanwhile is heard first", () => {
  const silence = new Silence(3000, 0);
  assert.equal(silence.look(3600_000), 0);
  silence.heard(3600_001);
  assert.equal(silence.look(3601_000), 0);
  const other = new Silence(3000, 0);
  assert.equal(other.look(3600_000), 0);
  assert.equal(other.look(3601_000), 3601_000);
});
