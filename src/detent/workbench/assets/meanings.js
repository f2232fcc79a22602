// What was clicked, while the table that says how things are is a moment behind. Knows no page.

export class Meanings {
  /**
   * `said` tells what the table says of a key.
   * @param {(key: string) => any} said
   */
  constructor(said) {
    this.said = said;
    /** @type {Map<string, [any, number]>} key -> what calls under way make of it, how many those are */
    this.made = new Map();
  }

  /**
   * What `key` is once all calls under way are done; if none is, what it is (`now`, or as the table says).
   * @param {string} key
   * @param {any} now
   */
  of(key, now = this.said(key)) {
    const one = this.made.get(key);
    return one ? one[0] : now;
  }

  /**
   * Whether calls are under way that make something else of `key`.
   * @param {string} key
   */
  underWay(key) {
    return this.made.has(key);
  }

  /** Whether any calls are under way. */
  get any() {
    return this.made.size > 0;
  }

  /**
   * Make the calls of `going`, which are to make `value` of `key`. The table has it before they are answered.
   * @template T
   * @param {string} key
   * @param {any} value
   * @param {() => Promise<T>} going
   * @returns {Promise<T>}
   */
  async make(key, value, going) {
    const one = this.made.get(key) || [value, 0];
    one[0] = value;
    one[1] += 1;
    this.made.set(key, one);
    try {
      return await going();
    } finally {
      one[1] -= 1;
      if (!one[1]) this.made.delete(key);
    }
  }
}
