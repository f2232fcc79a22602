// One look at a time: what is wanted while one is under way is looked at behind it, and never lost. Knows no page.

export class Looking {
  /** @param {() => Promise<void>} look may throw: then nothing more is looked at until it is wanted again */
  constructor(look) {
    this.look = look;
    this.under = false;
    this.again = false;
  }

  /** Look, now or as soon as the look under way is over. */
  async soon() {
    this.again = true;
    if (this.under) return;
    this.under = true;
    try {
      while (this.again) {
        this.again = false;
        await this.look();
      }
    } catch {
      /* the connection is told elsewhere */
    } finally {
      this.under = this.again = false;
    }
  }
}
