/* What goes to the unit, from the Motion page: typed to the unit of the cell, or said to one that is connected. For
   that, and for what was found by a search, the lines are shown first. */

import { element } from "./elements.js";

export class Sending {
  /**
   * @param {Part} root
   * @param {import("./motion.js").Motion} motion
   */
  constructor(root, motion) {
    this.motion = motion;
    this.told = root.querySelector(".motion-told");
    this.dialog = root.querySelector(".motion-dialog");
    this.dialog.addEventListener("click", (event) => {
      const key = /** @type {Part} */ (event.target).closest("button");
      if (key) this.dialog.close(key.value);
    });
    this.dialog.addEventListener("close", () => {
      const { agreed } = this;
      this.agreed = null;
      if (agreed) agreed(this.dialog.returnValue === "send");
    });
  }

  /**
   * @param {string[]} lines
   * @param {Detent["call"]} ask whose hand it was
   */
  async settings(lines, ask, words = "") {
    const { about } = this.motion;
    if (!about.real) await this.send(about, lines, ask);
    else if (await this.shown(about, lines, words)) await this.send(about, lines);
  }

  /**
   * @param {string[]} lines
   * @param {Detent["call"]} ask
   */
  async move(lines, ask) {
    await this.settings(lines, ask, "The motor moves.");
  }

  /**
   * Show the lines with what is to be known of them; whether they shall be sent to the unit of `about`.
   * @param {AxisFacts} about
   * @param {string[]} lines
   */
  shown(about, lines, words = "") {
    const { dialog } = this,
      { unit, model, real } = about;
    dialog.querySelector("h2").textContent = `To ${unit}${real ? ", a real unit" : ", in the cell"} (${model})`;
    dialog.querySelector("p").textContent = words;
    dialog.querySelector("ol").replaceChildren(...lines.map((line) => element("li", {}, line)));
    dialog.returnValue = "";
    dialog.showModal();
    dialog.querySelector("[value=cancel]").focus();
    return new Promise((agreed) => {
      this.agreed = agreed;
    });
  }

  /**
   * Line by line, to the unit that they were shown for, whatever the page shows by now; nothing follows a line that is
   * refused, nor a STOP.
   * @param {string[]} lines
   */
  async send(/** @type {AxisFacts} */ { unit, real }, lines, ask = window.detent.asking()) {
    const sent = [];
    if (real) {
      // one job of the unit: STOP, in whichever window, ends all of it
      const told = await this.motion.ask("unit_lines", unit, lines);
      if (!told) {
        this.told.textContent = "not all of it was obeyed: what was said stands on the Unit page";
        return false;
      }
      const refused = told.findIndex((/** @type {any} */ said) => said.refused);
      if (refused >= 0) return this.tell(lines.slice(0, refused), lines[refused], `was refused: ${told[refused].meaning || told[refused].answers.join(" ")}`);
      sent.push(...lines);
    } else for (const line of lines) {
      try {
        await ask("type", unit, line);
      } catch (error) {
        window.detent.failed(error);
        return this.tell(sent, line, "was not sent");
      }
      sent.push(line);
    }
    this.told.textContent = `sent: ${sent.join(", ")}; the answers are on the ${real ? "Unit" : "Terminal"} page`;
    return true;
  }

  /**
   * @param {string[]} sent
   * @param {string} line
   * @param {string} what
   */
  tell(sent, line, what) {
    this.told.textContent = `${line} ${what}; ${sent.length ? `sent before it: ${sent.join(", ")}` : "nothing was sent before it"}`;
    return false;
  }
}
