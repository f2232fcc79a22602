// What a person writes where bytes are meant. Knows no page.

/** @type {Record<string, string>} */
const NAMED = { r: "\r", n: "\n", t: "\t", "\\": "\\" };

/**
 * The bytes that a person writes with \r, \n, \t, \\ and \xHH, one character a byte.
 * @param {string} text
 */
export function bytes(text) {
  return text.replace(/\\(r|n|t|\\|x[0-9a-fA-F]{2})/g, (whole, one) =>
    one[0] === "x" ? String.fromCharCode(parseInt(one.slice(1), 16)) : NAMED[one]);
}
