// For how long nothing was heard from who should speak all the time. Knows no page.

export class Silence {
  /**
   * @param {number} most ms that may pass without a word
   * @param {number} now ms
   */
  constructor(most, now) {
    this.most = most;
    this.last = now;
    this.before = now;
  }

  /**
   * Something was heard.
   * @param {number} now
   */
  heard(now) {
    this.last = now;
  }

  /**
   * For how many ms nothing was heard, once that is too long; 0 until then. To be asked about every second: a page that was
   * asleep between two questions has not had its ears open, and asks once more before it says so.
   * @param {number} now
   */
  look(now) {
    const awake = now - this.before < this.most;
    this.before = now;
    const passed = now - this.last;
    return awake && passed > this.most ? passed : 0;
  }
}
