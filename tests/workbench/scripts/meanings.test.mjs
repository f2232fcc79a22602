import assert from "node:assert/strict";
import { test } from "node:test";

import { Meanings } from "./assets/meanings.js";

/** A call that ends when it is told to. */
function call() {
  let end;
  const done = new Promise((resolve, reject) => (end = { resolve, reject }));
  return { going: () => done, ...end };
}

test("while nothing is under way the table is right", () => {
  const meanings = new Meanings((key) => ({ held: false })[key]);
  assert.equal(meanings.of("held"), false);
  assert.equal(meanings.of("held", 7), 7);
  assert.equal(meanings.underWay("held"), false);
  assert.equal(meanings.any, false);
});

test("the second of two quick clicks takes the first one back", async () => {
  let held = false;
  const meanings = new Meanings(() => held);
  const turned = [];
  const calls = [call(), call()];
  for (const one of calls) {
    turned.push(!meanings.of("held"));
    meanings.make("held", turned.at(-1), one.going);
  }
  assert.deepEqual(turned, [true, false]);
  held = true; // the table is behind: it has the first only
  calls[0].resolve();
  await null;
  assert.equal(meanings.of("held"), false, "the second is still meant");
  held = false;
  calls[1].resolve();
  await new Promise(setImmediate);
  assert.equal(meanings.underWay("held"), false);
  assert.equal(meanings.of("held"), false);
});

test("a call that fails leaves no meaning behind, and what it gives is passed on", async () => {
  const meanings = new Meanings(() => 1);
  await assert.rejects(meanings.make("x", 2, () => Promise.reject(new Error("no"))), /no/);
  assert.equal(meanings.any, false);
  assert.equal(await meanings.make("x", 3, async () => "done"), "done");
});
