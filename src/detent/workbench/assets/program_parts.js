// A line of a program, cut into what it is made of. Knows no page.

/**
 * Cut a line into labels ([where, length]), the command with what follows (`rest`, from `start` on; `word` if the language has it),
 * and the comment (where it begins, -1: none); `code` is the line without it.
 * @param {string} text
 * @param {{comment: string, language: boolean, words: Spelling[]}} facts without a language there are no labels
 */
export function cut(text, { comment, language, words }) {
  const end = text.indexOf(comment),
    code = end < 0 ? text : text.slice(0, end);
  /** @type {[number, number][]} */
  const labels = [];
  let start = 0;
  if (language) {
    const label = /\s*([^\s:]+)\s*:/y;
    for (let match; (label.lastIndex = start), (match = label.exec(code)); start = label.lastIndex)
      labels.push([start + match[0].indexOf(match[1]), match[1].length]);
  }
  start += code.slice(start).search(/\S|$/);
  const rest = code.slice(start);
  const word = words.find(
    ({ spelling, whole }) => rest.startsWith(spelling) && (!whole || !/\w/.test(rest[spelling.length] || " ")),
  );
  return { code, comment: end, labels, start, word, rest };
}
