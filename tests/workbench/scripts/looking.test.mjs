import assert from "node:assert/strict";
import { test } from "node:test";

import { Looking } from "./assets/looking.js";

/** Looks that are answered one by one: `answer()` lets the one under way be over, `fail()` lets it fail. */
function slow() {
  const told = { looks: 0, answer: () => {}, fail: () => {} };
  const looking = new Looking(() => new Promise((resolve, reject) => {
    told.looks += 1;
    told.answer = resolve;
    told.fail = () => reject(new Error("no connection"));
  }));
  return { looking, told };
}

const settled = () => new Promise((done) => setImmediate(done));

test("what is wanted while one looks is looked at behind that, however often it was wanted", async () => {
  const { looking, told } = slow();
  for (let n = 0; n < 5; n += 1) looking.soon();
  assert.equal(told.looks, 1);
  told.answer();
  await settled();
  assert.equal(told.looks, 2);
  told.answer();
  await settled();
  assert.equal(told.looks, 2);
  looking.soon();
  assert.equal(told.looks, 3);
});

test("a look that fails is not begun again by itself, and the next that is wanted is", async () => {
  const { looking, told } = slow();
  looking.soon();
  looking.soon();
  told.fail();
  await settled();
  assert.equal(told.looks, 1);
  looking.soon();
  assert.equal(told.looks, 2);
});
