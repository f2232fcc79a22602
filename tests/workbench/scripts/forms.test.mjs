import assert from "node:assert/strict";
import { test } from "node:test";

import { apart, FORMS, grouped, pitch, remeasured, seconds, wholeSteps, wordsOf } from "./assets/forms.js";

test("numbers stand in groups of three, with a real minus", () => {
  assert.equal(grouped(0), "0");
  assert.equal(grouped(999), "999");
  assert.equal(grouped(1000), "1\u2009000");
  assert.equal(grouped(-16777215), "\u221216\u2009777\u2009215");
});

test("nanoseconds are cut to the microsecond, never rounded into the future", () => {
  assert.equal(seconds(null), "\u2013");
  assert.equal(seconds(0), "0.000\u2009000");
  assert.equal(seconds(999), "0.000\u2009000");
  assert.equal(seconds(1_234_567_999), "1.234\u2009567");
  assert.equal(seconds(3600e9), "3\u2009600.000\u2009000");
});

test("what is not known is told, in every form", () => {
  for (const [name, form] of Object.entries(FORMS)) assert.equal(typeof form(null), "string", name);
  assert.equal(FORMS.level(""), "\u00b7");
  assert.equal(FORMS.level(0), "0");
  assert.equal(FORMS.steps(12), "+12");
  assert.equal(FORMS.steps(-12), "\u221212");
  assert.equal(FORMS.pace(null), "as fast as it goes");
  assert.equal(FORMS.pace(0.01), "0.01\u00d7");
});

test("a scale is divided by 1, 2 or 5 into at most so many parts, and not into many less", () => {
  for (const most of [2, 5, 7, 12])
    for (let span = 1e-3; span < 1e12; span *= 1.37) {
      const step = pitch(span, most);
      const digit = step / 10 ** Math.floor(Math.log10(step) + 1e-9);
      assert.ok([1, 2, 5].some((nice) => Math.abs(digit - nice) < 1e-6), `${span} / ${most}: ${step}`);
      assert.ok(span / step <= most * (1 + 1e-9), `${span} / ${most}: ${step} is too fine`);
      assert.ok(span / step > most / 2.6, `${span} / ${most}: ${step} is too coarse`);
    }
});

test("whatever was thrown has words", () => {
  assert.equal(wordsOf(new Error("there is no unit")), "there is no unit");
  assert.equal(wordsOf("no unit"), "no unit");
  assert.equal(wordsOf(undefined), "undefined");
});

test("another measure is the same length, and what is no number stays what it is", () => {
  assert.equal(remeasured("100", 1, 200), "0.5");
  assert.equal(remeasured("0.5", 200, 1), "100");
  assert.equal(remeasured("-90", 10 / 9, 1), "-100");
  for (const written of ["", " ", "x", "Infinity"]) assert.equal(remeasured(written, 1, 200), written);
  assert.equal(remeasured("100", 3, 3), "100");
});

test("of two names what tells them apart is shown", () => {
  assert.equal(apart("gs-c200 /dev/ttyUSB0 address=2", "gs-c200 /dev/ttyUSB0 address=1"), "\u2026 address=2");
  assert.equal(apart("gs-c200 (cell)", "gs-c200 /dev/ttyUSB0"), "\u2026 (cell)");
  assert.equal(apart("dcb-274 (cell)", "gs-c200 (cell)"), "dcb-274 (cell)");
  assert.equal(apart("a", "a b"), "a");
});

test("a length is whole steps, and one that nobody goes is refused in words", () => {
  assert.equal(wholeSteps(2.5), 3);
  assert.equal(wholeSteps(-99.6), -100);
  for (const far of [2 ** 31, -(2 ** 40), 1e300, Infinity]) assert.throws(() => wholeSteps(far), /farther/);
});
