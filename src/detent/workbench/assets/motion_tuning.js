/* Tuning on the Motion page: the search with its progress, what it found, and the map of losses, a picture to click in.
   The search itself runs on the server (detent/workbench/tuning.py), and goes on when this page is left. */

import { LossMap } from "./motion_map.js";
import { element } from "./elements.js";

/** @type {Record<string, string>} */
const STATES = {
  searching: "searching",
  mapping: "found; the map is being made",
  stopped: "stopped",
  failed: "nothing found",
  done: "found",
};

export class Tuning {
  /**
   * @param {Part} root
   * @param {import("./motion.js").Motion} motion
   */
  constructor(root, motion) {
    this.motion = motion;
    this.panel = root.querySelector(".motion-tuning");
    this.find = (/** @type {string} */ selector) => this.panel.querySelector(selector);
    this.form = this.find("form");
    this.map = new LossMap(this.find(".motion-map"), (x, y) => this.pick(x, y));
    this.form.addEventListener("submit", (/** @type {Event} */ event) => {
      event.preventDefault();
      this.search();
    });
    this.ends = [
      detent.on("tuning", () => this.soon()),
      detent.onTheme(() => this.map.paint()),
    ];
  }

  close() {
    this.closed = true;
    this.map.close();
    for (const end of this.ends) if (typeof end === "function") end();
  }

  /* The axis is another. */
  moved() {
    const field = this.form.elements.moves;
    if (!field.dataset.touched) field.value = this.motion.steps;
    field.oninput = () => {
      field.dataset.touched = "yes";
    };
    this.soon();
  }

  /* Whether what is known is of the axis that is shown. */
  get mine() {
    const { about } = this.motion,
      told = detent.get("tuning") || {};
    return about && told.unit === about.unit && told.axis === about.axis && told.real === about.real;
  }

  soon() {
    if (this.waiting || this.closed) return;
    this.waiting = true;
    queueMicrotask(() => {
      this.waiting = false;
      if (!this.closed) this.show();
    });
  }

  show() {
    const told = detent.get("tuning") || { state: "idle" },
      { mine } = this,
      running = told.state === "searching" || told.state === "mapping",
      found = mine ? detent.get("tuning.found") : null,
      map = mine ? detent.get("tuning.map") : null;
    this.panel.dataset.state = mine ? told.state : "idle";
    this.find("[data-key=search]").disabled = running;
    this.find("[data-key=stop-search]").disabled = !running;
    const about = told.state === "idle" ? "" : `${told.unit}: ${told.moves} steps with ${told.motor}, ${STATES[told.state]}`;
    this.find(".motion-search-told").textContent = about;
    const bar = this.find(".motion-progress");
    bar.hidden = !running;
    if (running) {
      const progress = bar.querySelector("progress");
      if (told.total) progress.value = Math.min(told.done / told.total, 1);
      else progress.removeAttribute("value");
      const best = told.best === null ? "" : `, lossless at ${told.best.toPrecision(4)} s`,
        left = told.left === null ? "" : `, about ${told.left} s left`;
      const count = told.total ? `${told.done} of about ${told.total}, ` : "";
      bar.querySelector("span").textContent = `${count}${told.doing}${best}${left}`;
    }
    this.find(".motion-problem").textContent = mine && !running ? told.words : "";
    this.showFound(found);
    this.map.take(map);
  }

  /* -- what was found -------------------------------------------------------------------------------------------- */

  /** @param {any} found */
  showFound(found) {
    this.found = found;
    this.find(".motion-found").hidden = !found;
    if (!found || found === this.shown) return;
    this.shown = found;
    const lines = [...found.commands, ...found.option_lines.map((/** @type {string} */ line) => `option ${line}`)];
    this.find(".motion-found-lines").replaceChildren(...lines.map((line) => element("span", {}, line)));
    this.find("[data-key=send-found]").disabled = !found.commands.length;
    /** @param {number | undefined} value */
    const seconds = (value) => (value === undefined ? "" : `${value.toFixed(4)} s`);
    const rivals = [
      ["found", (/** @type {number} */ k) => found.moves[k].time_s, found.time_s],
      ...(found.hand ? [["by hand", (/** @type {number} */ k) => found.hand.moves_s[k], found.hand.time_s]] : []),
      ...(found.hand_safe && found.hand && found.hand_safe.words !== found.hand.words
        ? [["by hand, made safe", (/** @type {number} */ k) => found.hand_safe.moves_s[k], found.hand_safe.time_s]]
        : []),
      ["bound", (/** @type {number} */ k) => found.moves[k].bound_s.worst, found.bound_s],
    ];
    /** @param {string} text */
    const cell = (text, kind = /** @type {"td" | "th"} */ ("td")) => element(kind, kind === "th" ? { scope: "col" } : {}, text);
    /**
     * @param {string} name
     * @param {string} sent
     * @param {any[]} values
     */
    const row = (name, sent, values) =>
      element("tr", {}, element("th", { scope: "row" }, name), cell(sent), ...values.map((value) => cell(seconds(value))));
    const body = found.moves.map((/** @type {any} */ move, /** @type {number} */ k) =>
      row(
        move.weight === 1 ? `${move.steps}` : `${move.steps} \u00d7${move.weight}`,
        move.go,
        rivals.map(([, time]) => time(k)),
      ),
    );
    if (found.moves.length > 1 || found.moves[0].weight !== 1) body.push(row("all", "", rivals.map(([, , all]) => all)));
    this.find(".motion-found table").replaceChildren(
      element("thead", {}, element("tr", {}, ...["move", "sent as", ...rivals.map(([name]) => name)].map((text) => cell(text, "th")))),
      element("tbody", {}, ...body),
    );
    const hand = found.hand
      ? `By hand: ${found.hand.words}, by the manual's rule: ${found.hand.lost} of ${found.hand.variants} lose a step. `
      : "";
    const known = [
      found.complete ? "" : "Stopped: the best so far, which nothing has proved yet. ",
      found.commands.length ? "" : `No setting is sent for it: ${found.option_lines.length ? "its options are burnt into the drive's EPROM, or stand in the cell file; " : ""}what a move needs is said with it, under "sent as". `,
      `${found.check.words[0].toUpperCase()}${found.check.words.slice(1)}. `,
      hand,
      Number.isFinite(found.ratio) ? `It takes ${found.ratio.toFixed(2)} times what torque allows at its worst. ` : "",
      found.fails_words ? `Fails first, one at a time: ${found.fails_words}. ` : "",
      found.models.length ? `In other models, lost of ${found.models[0].tried}: ${found.models_words}. ` : "",
      found.both_ways ? "Judged in both directions, as the load pulls. " : "",
      found.gpu ? "Judged on the GPU." : "",
    ];
    this.find(".motion-known").textContent = known.join("");
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  async pick(x, y) {
    const picked = await this.motion.ask("tuning_pick", x, y);
    if (!picked) return false;
    await this.motion.take(picked);
    const times = picked.times.map((/** @type {number} */ time) => `${time.toFixed(4)} s`).join(", ");
    this.map.say(`taken over: ${picked.settings_words}: ${times}`);
    return true;
  }

  async search() {
    const { motion, form } = this,
      asked = motion.form.asked();
    if (!asked) {
      detent.toast("Choose a motor first: a search asks what it makes of each move", "error");
      motion.find("select[name=motor]").focus();
      return;
    }
    const { moves, variants, corners, map, vary } = form.elements;
    await motion.ask("tuning_begin", motion.request, asked, {
      moves: moves.value,
      variants: Number(variants.value),
      corners: corners.checked,
      map: map.checked,
      vary: vary.value,
    });
  }

  /* The map as it is seen; null without one. */
  canvas() {
    return this.map.map ? this.map.canvas : null;
  }

  /** What the keys do, by their `data-key`. */
  get actions() {
    return {
      "stop-search": () => this.motion.ask("tuning_stop"),
      take: () => this.motion.take(this.found),
      "send-found": async () => {
        const { commands, resets } = this.found,
          { sending, about } = this.motion;
        const words = resets.length
          ? `${resets.join(", ")} resets the board: it stops, its position becomes 0, and moves are counted in other microsteps.`
          : "";
        if (!(await sending.shown(about, commands, words))) return;
        await this.motion.take(this.found);
        if (!(await sending.send(about, commands))) return;
        this.motion.find(".motion-told").scrollIntoView({ block: "nearest" });
      },
      copy: async () => {
        const { commands, option_lines } = this.found;
        try {
          await navigator.clipboard.writeText([...commands, ...option_lines].join("\n") + "\n");
          detent.toast("copied");
        } catch {
          detent.toast("The browser lets nobody copy here: select the lines", "error");
        }
      },
    };
  }
}
