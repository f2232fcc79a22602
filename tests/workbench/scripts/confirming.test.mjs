import assert from "node:assert/strict";
import { test } from "node:test";

import { ALL, Confirming } from "./assets/confirming.js";

test("a stop of another unit does not confirm this one", () => {
  const stops = new Confirming();
  const first = stops.begin("a");
  const second = stops.begin("b");
  stops.tell("a", first, "a may move");
  stops.done("b", second);
  assert.equal(stops.words, "a may move");
  stops.done("a", first);
  assert.equal(stops.words, "");
});

test("a failure is told though another unit was stopped behind it", () => {
  const stops = new Confirming();
  const first = stops.begin("a");
  stops.done("b", stops.begin("b"));
  stops.tell("a", first, "a may move");
  assert.equal(stops.words, "a may move");
});

test("the newest stop of a unit counts, and the STOP of everything is one of each", () => {
  const stops = new Confirming();
  const old = stops.begin("a");
  const next = stops.begin("a");
  stops.tell("a", next, "not yet");
  stops.done("a", old);
  assert.equal(stops.words, "not yet");
  const all = stops.begin(ALL);
  stops.tell(ALL, all, "not yet");
  assert.equal(stops.words, "not yet");
  stops.done(ALL, all);
  assert.equal(stops.words, "");
});

test("what one unit fails to confirm is told though all were asked to stop before", () => {
  const stops = new Confirming();
  const all = stops.begin(ALL);
  const one = stops.begin("a");
  stops.tell("a", one, "a may move");
  stops.done(ALL, all);
  assert.equal(stops.words, "a may move");
});

test("who has seen that a stop is not confirmed yet is told that it never will be", () => {
  const stops = new Confirming();
  const first = stops.begin("a");
  stops.tell("a", first, "not yet");
  stops.seen();
  assert.equal(stops.words, "");
  stops.tell("a", first, "failed");
  assert.equal(stops.words, "failed");
});
