import assert from "node:assert/strict";
import { test } from "node:test";

import { cut } from "./assets/program_parts.js";

const word = (spelling, whole = false) => ({ spelling, whole, rows: [] });
const language = { comment: ";", language: true, words: [word("++"), word("+"), word("JP", true)] };

test("a line is labels, a command and a comment", () => {
  const { code, comment, labels, start, word: found, rest } = cut(" begin: again:  +1000 ; forward", language);
  assert.equal(code, " begin: again:  +1000 ");
  assert.equal(comment, 22);
  assert.deepEqual(labels, [[1, 5], [8, 5]]);
  assert.equal(start, 16);
  assert.equal(rest, "+1000 ");
  assert.equal(found.spelling, "+");
});

test("the first spelling that fits is meant, and a word is whole", () => {
  assert.equal(cut("++7", language).word.spelling, "++");
  assert.equal(cut("JP again", language).word.spelling, "JP");
  assert.equal(cut("JPX", language).word, undefined);
  assert.equal(cut("JP", language).word.spelling, "JP");
});

test("an empty line, a comment, a label alone", () => {
  assert.deepEqual(cut("", language), { code: "", comment: -1, labels: [], start: 0, word: undefined, rest: "" });
  assert.equal(cut("; all of it", language).code, "");
  assert.deepEqual(cut("end:", language).labels, [[0, 3]]);
});

test("what holds no programs has no labels", () => {
  assert.deepEqual(cut("a: 1", { ...language, language: false }).labels, []);
});
