/* The tools around the scope's plot: buttons, the labels of the lanes, the choice of traces, the trigger, the export.

   They are built from the catalogue of traces that the feed sends:
   {id, unit, name, title, lane, shape, level, units}. */

import { element } from "./elements.js";
import { showNumber, showRate, showSpan, showTime } from "./scope_plot.js";

/**
 * @param {string} label
 * @param {string} help
 * @param {() => void} action
 */
const key = (label, help, action, more = {}) =>
  element(
    "button",
    { type: "button", class: "key small", "aria-label": help, "data-help": help, onclick: action, ...more },
    label,
  );

export class Tools {
  /**
   * @param {HTMLElement} root
   * @param {import("./scope.js").Scope} scope
   */
  constructor(root, scope) {
    this.scope = scope;
    this.followKey = key("Follow", "Follow the present", () => scope.follow(), {
      "aria-pressed": "true",
      class: "key small scope-follow",
    });
    this.cursorKey = key("Cursors", "Two cursors with their differences", () => scope.toggleCursors(), {
      "aria-pressed": "false",
    });
    this.span = element("output", { class: "mono quiet scope-span", "aria-label": "width of the view" });
    this.traces = this.menu("Traces", "scope-traces");
    this.trigger = this.menu("Trigger", "scope-trigger");
    this.files = this.menu("Export", "scope-export");
    this.source = this.choice("trigger source", [["error", "any error"]]);
    this.edge = this.choice("trigger edge", [
      ["rise", "rising"],
      ["fall", "falling"],
      ["both", "either way"],
    ]);
    this.level = element("input", {
      class: "field mono",
      type: "number",
      step: "any",
      value: 0,
      "aria-label": "trigger level",
      onchange: () => this.arm(),
    });
    this.mode = this.choice("trigger mode", [
      ["off", "off"],
      ["normal", "each time"],
      ["single", "once"],
    ]);
    this.levelRow = element("label", {}, element("span", {}, "crosses"), this.level);
    this.edgeRow = element("label", {}, element("span", {}, "edge"), this.edge);
    this.found = element("output", { class: "quiet" });
    /** @type {Map<string | undefined, Trace>} the catalogue */
    this.byId = new Map();
    this.away = (/** @type {Event} */ event) => {
      const at = /** @type {Node} */ (event.target);
      for (const { details } of this.menus) if (details.open && !details.contains(at)) details.open = false;
    };
    root.append(
      element(
        "div",
        { class: "row scope-keys" },
        this.followKey,
        key("\u2212", "Show more time", () => scope.input.zoom(1.6)),
        key("+", "Show less time", () => scope.input.zoom(1 / 1.6)),
        key("All", "All: everything since the beginning", () => scope.fit()),
        this.cursorKey,
        this.span,
      ),
      element("div", { class: "row scope-menus" }, this.traces.details, this.trigger.details, this.files.details),
    );
    this.triggerPanel();
    this.exportPanel();
    document.addEventListener("pointerdown", this.away);
  }

  get menus() {
    return [this.traces, this.trigger, this.files];
  }

  close() {
    document.removeEventListener("pointerdown", this.away);
  }

  /**
   * @param {string} name
   * @param {string} kind
   */
  menu(name, kind) {
    const panel = element("div", { class: "scope-panel panel" });
    const summary = element("summary", { class: "key small" }, name);
    const details = element("details", { class: `scope-menu ${kind}` }, summary, panel);
    details.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && details.open) {
        details.open = false;
        summary.focus();
        event.stopPropagation();
      }
    });
    details.addEventListener("toggle", () => {
      if (details.open) for (const other of this.menus) if (other.details !== details) other.details.open = false;
    });
    return { details, panel };
  }

  /* -- which traces ------------------------------------------------------------------------------------- */

  /**
   * @param {Trace[]} catalogue
   * @param {string[]} shown
   */
  offer(catalogue, shown) {
    const { panel } = this.traces;
    const search = element("input", {
      class: "field",
      type: "search",
      placeholder: "search",
      "aria-label": "search traces",
    });
    const groups = new Map();
    for (const trace of catalogue) {
      if (!groups.has(trace.unit)) groups.set(trace.unit, element("fieldset", {}, element("legend", {}, trace.unit)));
      const box = element("input", {
        type: "checkbox",
        value: trace.id,
        onchange: () => this.scope.show(trace.id, box.checked),
      });
      box.checked = shown.includes(trace.id);
      groups
        .get(trace.unit)
        .append(
          element(
            "label",
            { "data-help": trace.title, "data-words": `${trace.id} ${trace.title}`.toLowerCase() },
            box,
            element("span", { class: "mono" }, trace.name),
            element("span", { class: "quiet" }, trace.title),
          ),
        );
    }
    search.addEventListener("input", () => {
      for (const label of panel.querySelectorAll("label"))
        label.hidden = !label.dataset.words?.includes(search.value.toLowerCase());
      for (const group of groups.values()) group.hidden = !group.querySelector("label:not([hidden])");
    });
    panel.replaceChildren(search, element("div", { class: "scope-list" }, ...groups.values()));
    const select = this.source,
      before = select.value;
    select.replaceChildren(
      element("option", { value: "error" }, "any error"),
      ...catalogue.map((trace) => element("option", { value: trace.id }, trace.id)),
    );
    select.value = [...select.options].some((option) => option.value === before) ? before : "error";
    this.byId = new Map(catalogue.map((trace) => [trace.id, trace]));
    this.arm();
  }

  /** @param {string[]} shown */
  tick(shown) {
    for (const box of this.boxes())
      box.checked = shown.includes(box.value);
  }

  /** @returns {NodeListOf<HTMLInputElement>} */
  boxes() {
    return this.traces.panel.querySelectorAll("input[type=checkbox]");
  }

  /* -- the trigger -------------------------------------------------------------------------------------- */

  /**
   * @param {string} label
   * @param {string[][]} options value, words
   */
  choice(label, options) {
    return element(
      "select",
      { class: "field", "aria-label": label, onchange: () => this.arm() },
      ...options.map(([value, words]) => element("option", { value }, words)),
    );
  }

  triggerPanel() {
    this.trigger.panel.append(
      element("label", {}, element("span", {}, "on"), this.source),
      this.edgeRow,
      this.levelRow,
      element("label", {}, element("span", {}, "hold the view"), this.mode),
      element(
        "div",
        { class: "row" },
        key("\u25c2 Before", "Go to the trigger before", () => this.scope.find(-1)),
        key("Next \u25b8", "Go to the next trigger", () => this.scope.find(1)),
      ),
      this.found,
    );
  }

  /* The trigger as it is set: {source, edge, level}. */
  get set() {
    return { source: this.source.value, edge: this.edge.value, level: Number(this.level.value) || 0 };
  }

  arm() {
    const trace = this.byId.get(this.source.value);
    this.edgeRow.hidden = !trace;
    this.levelRow.hidden = !trace || trace.level;
    this.trigger.details.classList.toggle("armed", this.mode.value !== "off");
    this.scope.arm(this.mode.value === "off" ? null : { ...this.set, mode: this.mode.value });
  }

  disarm() {
    this.mode.value = "off";
    this.trigger.details.classList.remove("armed");
  }

  /** @param {string} text */
  say(text) {
    this.found.textContent = text;
  }

  /* -- files --------------------------------------------------------------------------------------------- */

  exportPanel() {
    const kinds = [
      ["png", "PNG", "what is seen here, as a picture"],
      ["csv", "CSV", "the shown traces in this view, as a table"],
      ["vcd", "VCD", "all wires, exact to the nanosecond"],
      ["sr", "sigrok", "all wires, for PulseView"],
      ["npz", "NumPy", "pulses, wires and rotors as arrays"],
    ];
    for (const [kind, name, words] of kinds)
      this.files.panel.append(
        element(
          "button",
          {
            type: "button",
            class: "scope-file",
            "data-kind": kind,
            onclick: () => {
              this.files.details.open = false;
              this.scope.save(kind);
            },
          },
          element("b", {}, name),
          element("span", { class: "quiet" }, words),
        ),
      );
  }

  /* -- what is shown ------------------------------------------------------------------------------------- */

  /**
   * The labels of the lanes, beside them.
   * @param {HTMLElement} place
   * @param {import("./scope_plot.js").Plot} plot
   */
  label(place, plot) {
    place.replaceChildren(
      ...plot.lanes.map((lane) =>
        element(
          "li",
          { class: lane.level ? "scope-lane level" : "scope-lane", style: `top:${lane.top}px;height:${lane.height}px` },
          ...lane.traces.map((trace) =>
            element(
              "div",
              {
                class: "scope-name",
                "data-trace": trace.id,
                style: `--colour:var(--scope-trace-${(trace.index % 8) + 1})`,
              },
              element(
                "span",
                { class: "scope-title", "data-help": trace.title },
                element("i"),
                element("b", {}, trace.unit),
                " ",
                trace.name,
              ),
              element("span", { class: "mono scope-value", "data-units": trace.level ? "" : trace.units }),
              element(
                "button",
                {
                  type: "button",
                  class: "scope-drop",
                  "aria-label": `remove ${trace.id}`,
                  onclick: () => this.scope.show(trace.id, false),
                },
                "\u00d7",
              ),
            ),
          ),
        ),
      ),
    );
  }

  /**
   * Readings at the cursors, or of the present: values are [a, b] by trace id.
   * @param {HTMLElement} place
   * @param {Record<string, any>} values
   * @param {(number | null)[]} cursors
   * @param {View} view
   * @param {boolean} following
   */
  read(place, values, cursors, view, following) {
    this.followKey.setAttribute("aria-pressed", String(following));
    this.cursorKey.setAttribute(
      "aria-pressed",
      String(cursors.some((at) => at !== null)),
    );
    this.span.textContent = showSpan(view.end - view.begin);
    for (const name of /** @type {Part} */ (place).querySelectorAll(".scope-name")) {
      const trace = this.byId.get(name.dataset.trace),
        reading = values[name.dataset.trace];
      /** @param {any} value */
      const show = (value) =>
        value === null || value === undefined ? "\u2013" : trace?.level ? String(value) : showNumber(value);
      const [a, b] = reading || [];
      let text = reading ? show(a) : "";
      if (reading && cursors[1] !== null) {
        text = cursors[0] === null ? show(b) : `${show(a)} \u2192 ${show(b)}`;
        if (cursors[0] !== null && !trace?.level && a !== null && b !== null) text += `\n\u0394 ${showNumber(b - a)}`;
      }
      const cell = name.querySelector(".scope-value");
      if (cell.textContent !== text) cell.textContent = text;
    }
  }

  /**
   * The strip of the two cursors.
   * @param {HTMLElement} strip
   * @param {(number | null)[]} cursors
   * @param {View} view
   */
  differ(strip, cursors, view) {
    strip.hidden = cursors.every((at) => at === null);
    if (strip.hidden) return;
    const step = (view.end - view.begin) / 1000,
      [a, b] = cursors;
    const parts = [
      ["A", a === null ? "\u2013" : showTime(a, step)],
      ["B", b === null ? "\u2013" : showTime(b, step)],
    ];
    if (a !== null && b !== null) {
      parts.push(["\u0394t", showSpan(b - a)]);
      if (a !== b) parts.push(["1/\u0394t", showRate(1e9 / Math.abs(b - a))]);
    }
    strip.replaceChildren(
      ...parts.map(([name, value]) =>
        element("span", {}, element("b", {}, name), element("span", { class: "mono" }, value)),
      ),
    );
  }
}
