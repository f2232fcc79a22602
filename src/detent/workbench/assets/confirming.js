// Which stops are not confirmed. What is told of one of them stays until that one is, or somebody has seen it: a stop of
// something else that went well says nothing of it. Knows no page.

export const ALL = ""; // the STOP of everything

export class Confirming {
  constructor() {
    /** @type {Map<string, number>} who is stopped -> the newest stop of it */
    this.newest = new Map();
    /** @type {Map<string, string>} who is stopped -> what is told of that */
    this.told = new Map();
    this.count = 0;
  }

  /**
   * A stop of `who` begins; its number.
   * @param {string} who
   */
  begin(who) {
    this.count += 1;
    this.newest.set(who, this.count);
    return this.count;
  }

  /**
   * What is to be told of a stop; nothing where a newer one of the same is under way.
   * @param {string} who
   * @param {number} number
   * @param {string} words
   */
  tell(who, number, words) {
    if (this.newest.get(who) === number) this.told.set(who, words);
  }

  /**
   * A stop is confirmed: so are, if it was the STOP of everything, those that began before it.
   * @param {string} who
   * @param {number} number
   */
  done(who, number) {
    for (const [one, newest] of this.newest) {
      if (one === who ? newest === number : who === ALL && newest < number) this.told.delete(one);
    }
  }

  /** Somebody has seen it. How a stop that is under way ends is told all the same. */
  seen() {
    this.told.clear();
  }

  /** What stands above the page. */
  get words() {
    return [...new Set(this.told.values())].join(" \u00b7 ");
  }
}
