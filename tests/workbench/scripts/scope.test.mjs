import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { decode } from "./assets/scope_feed.js";
import { niceStep, showNumber, showRate, showSpan, showTime } from "./assets/scope_plot.js";

/** What the process of the pages packed, and what it packed it of. */
function packed(name) {
  const bytes = readFileSync(new URL(`./${name}`, import.meta.url));
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
}

test("a frame is read as it was packed", () => {
  const frame = decode(packed("frame.bin"));
  const made = JSON.parse(readFileSync(new URL("./frame.json", import.meta.url), "utf8"));
  assert.deepEqual([frame.begin, frame.width, frame.count], [made.begin, made.width, made.columns]);
  for (const [row, trace] of frame.traces.entries()) {
    assert.equal(trace.id, made.keys[row]);
    assert.deepEqual([...trace.low].map((value) => value + trace.base), made.low[row]);
    assert.deepEqual([...trace.high].map((value) => value + trace.base), made.high[row]);
  }
});

test("a file comes with its bytes, whatever the length of its name", () => {
  for (const name of ["a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg", "abcdefgh"]) {
    const file = decode(packed(`file-${name}.bin`));
    assert.equal(file.file, name);
    assert.equal(new TextDecoder().decode(file.bytes), `what is in ${name}`);
  }
});

test("a step is 1, 2 or 5 times a power of ten, and not below what is asked for", () => {
  for (let least = 1e-9; least < 1e9; least *= 1.7) {
    const step = niceStep(least);
    assert.ok(step >= least * 0.999999 && step < least * 2.6, `${least}: ${step}`);
  }
});

test("times, lengths, rates and values are written for people", () => {
  assert.equal(showTime(1_234_567_000, 1000), "1.234\u2009567 s");
  assert.equal(showTime(2e9, 1e9), "2 s");
  assert.equal(showSpan(1_250_000), "1.25 ms");
  assert.equal(showSpan(-2e9), "-2 s");
  assert.equal(showSpan(7), "7 ns");
  assert.equal(showRate(1.5e6), "1.5 MHz");
  assert.equal(showRate(12), "12 Hz");
  assert.equal(showNumber(-0.001, 1), "0");
  assert.equal(showNumber(-12.345, 0.1), "\u221212.3");
});
