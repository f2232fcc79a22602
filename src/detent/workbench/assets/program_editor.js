/* The editor of the Program page: CodeMirror, as NiceGUI brings it, told the language of a unit from the table of its
   controller: colours, completion, help, errors, addresses, breakpoints and the line that runs. */

import { cut } from "./program_parts.js";

/** @type {any} */
let CM = null;

/**
 * The editor in `place`. `told` has changed(typed), toggled(line), keys {key: action}.
 * @param {HTMLElement} place
 * @param {any} told
 */
export async function makeEditor(place, told) {
  await prepare();
  return new Editor(place, told);
}

class Editor {
  /**
   * @param {HTMLElement} place
   * @param {any} told
   */
  constructor(place, told) {
    this.told = told;
    /** @type {{words: Spelling[], comment: string, language: boolean}} */
    this.facts = { words: [], comment: ";", language: true };
    /** @type {Record<string, number>} */
    this.labels = {};
    this.addresses = ranges();
    this.breakpoints = ranges();
    this.errors = ranges(true);
    this.spots = ranges(); // the running line, lines that differ
    this.quiet = false; // a change that is ours and no typing
    this.view = new CM.EditorView({ parent: place, doc: "", extensions: this.extensions() });
    this.view.contentDOM.setAttribute("aria-label", "Program");
  }

  get text() {
    return this.view.state.doc.toString();
  }

  get line() {
    return this.view.state.doc.lineAt(this.view.state.selection.main.head).number;
  }

  /**
   * Show another text; nobody has typed it.
   * @param {string} text
   */
  set(text) {
    this.quiet = true;
    this.view.dispatch({
      changes: { from: 0, to: this.view.state.doc.length, insert: text },
      selection: { anchor: 0 },
    });
    this.quiet = false;
  }

  /**
   * Take the language of a unit (what `program_about` gave).
   * @param {any} facts
   */
  speak(facts) {
    this.facts = facts;
    this.view.dispatch({ effects: this.language.reconfigure(this.colours()) });
  }

  close() {
    this.view.destroy();
  }

  focus() {
    this.view.focus();
  }

  /* -- what is shown beside and under the text ------------------------------------------------------------- */

  /**
   * What `program_check` found.
   * @param {{errors: [number, number, number, string][], places: [number, number, number][], labels: Record<string, number>}} found
   */
  check({ errors, places, labels }) {
    const { doc } = this.view.state;
    this.labels = labels;
    this.view.dispatch({
      effects: [
        this.addresses.set.of(
          places
            .filter(([line]) => line <= doc.lines)
            .map(([line, address, bytes]) => new Place(address, bytes).range(doc.line(line).from)),
        ),
        this.errors.set.of(
          errors
            .filter(([line]) => line <= doc.lines)
            .map(([line, column, length, message]) => {
              const { from, to } = doc.line(line),
                begin = Math.min(from + column - 1, Math.max(to - 1, from));
              return CM.Decoration.mark({ class: "cm-wrong", message }).range(
                begin,
                Math.max(Math.min(begin + length, to), begin + Number(to > begin)),
              );
            })
            .filter((/** @type {{from: number, to: number}} */ { from, to }) => to > from),
        ),
      ],
    });
  }

  /** @param {number[]} lines */
  breakAt(lines) {
    const { doc } = this.view.state;
    this.view.dispatch({
      effects: this.breakpoints.set.of(
        lines.filter((line) => line <= doc.lines).map((line) => new Dot().range(doc.line(line).from)),
      ),
    });
  }

  get breakLines() {
    /** @type {number[]} */
    const lines = [],
      { doc } = this.view.state;
    for (const cursor = this.view.state.field(this.breakpoints.field).iter(); cursor.value; cursor.next())
      lines.push(doc.lineAt(cursor.from).number);
    return [...new Set(lines)];
  }

  /**
   * The line that runs (null: none), whether it stands there, and the lines that differ from memory.
   * @param {number | null} running
   * @param {boolean} stands
   * @param {number[]} different
   */
  spot(running, stands, different) {
    const { doc } = this.view.state,
      /** @type {[number, string][]} */
      lines = [];
    for (const line of different) if (line <= doc.lines) lines.push([line, "cm-differs"]);
    if (running !== null && running <= doc.lines) lines.push([running, stands ? "cm-runs cm-stands" : "cm-runs"]);
    lines.sort((a, b) => a[0] - b[0]);
    this.view.dispatch({
      effects: this.spots.set.of(
        lines.map(([line, kind]) => CM.Decoration.line({ class: kind }).range(doc.line(line).from)),
      ),
    });
  }

  /** @param {number} line */
  reveal(line) {
    const { doc } = this.view.state;
    if (line <= doc.lines)
      this.view.dispatch({ effects: CM.EditorView.scrollIntoView(doc.line(line).from, { y: "nearest", yMargin: 60 }) });
  }

  /** @param {number} line */
  goTo(line, column = 1) {
    const { doc } = this.view.state,
      { from, to } = doc.line(Math.min(line, doc.lines));
    this.view.dispatch({ selection: { anchor: Math.min(from + column - 1, to) }, scrollIntoView: true });
    this.view.focus();
  }

  /* -- how it is made --------------------------------------------------------------------------------------- */

  extensions() {
    this.language = new CM.Compartment();
    const data = [{ autocomplete: (/** @type {any} */ context) => this.complete(context) }]; // one and the same: a new one begins anew
    /**
     * @param {any} view
     * @param {{from: number}} line
     */
    const toggle = (view, line) => {
      this.told.toggled(view.state.doc.lineAt(line.from).number);
      return true;
    };
    const changes = CM.EditorView.updateListener.of((/** @type {any} */ update) => {
      if (update.docChanged) this.told.changed(!this.quiet);
    });
    const actions = Object.entries(this.told.keys || {}).map(([key, action]) => ({
      key,
      run: () => {
        action();
        return true;
      },
      preventDefault: true,
    }));
    return [
      CM.Prec.high(CM.keymap.of(actions)),
      this.addresses.field,
      this.breakpoints.field,
      this.errors.field,
      this.spots.field,
      CM.gutter({
        class: "cm-breaks",
        renderEmptyElements: true,
        markers: (/** @type {any} */ view) => view.state.field(this.breakpoints.field),
        initialSpacer: () => new Dot(),
        domEventHandlers: { mousedown: toggle },
      }),
      CM.basicSetup,
      CM.gutter({
        class: "cm-addresses",
        markers: (/** @type {any} */ view) => view.state.field(this.addresses.field),
        initialSpacer: () => new Place(1000, 4),
        domEventHandlers: { mousedown: toggle },
      }),
      CM.EditorView.decorations.from(this.errors.field),
      CM.EditorView.decorations.from(this.spots.field),
      CM.EditorState.languageData.of(() => data),
      CM.hoverTooltip((/** @type {any} */ view, /** @type {number} */ at) => this.help(view, at), { hoverTime: 250 }),
      this.language.of([]),
      changes,
      CM.EditorView.contentAttributes.of({ tabindex: "0" }),
      CM.EditorView.theme({ "&": { height: "100%" }, ".cm-scroller": { overflow: "auto" } }),
    ];
  }

  /**
   * A line cut into labels, command and comment.
   * @param {string} text
   */
  parts(text) {
    return cut(text, this.facts);
  }

  colours() {
    const self = this,
      { language, words } = this.facts;
    const before = !language && !words.some(({ whole }) => whole); // the value stands before its command
    /** @param {string} kind */
    const mark = (kind) => CM.Decoration.mark({ class: kind });
    /** @type {Record<string, any>} */
    const kinds = {
      command: mark("cm-command"),
      label: mark("cm-label"),
      number: mark("cm-number"),
      comment: mark("cm-note"),
    };
    const known = new Set(words.map(({ spelling }) => spelling));
    /** @param {any} view */
    const decorate = (view) => {
      /** @type {any[]} */
      const builder = [];
      /**
       * @param {number} from
       * @param {number} to
       * @param {string} kind
       */
      const add = (from, to, kind) => to > from && builder.push(kinds[kind].range(from, to));
      for (const { from, to } of view.visibleRanges) {
        for (let at = from; at <= to;) {
          const line = view.state.doc.lineAt(at),
            parts = self.parts(line.text);
          for (const [start, length] of parts.labels) add(line.from + start, line.from + start + length, "label");
          const waits = !language && parts.rest.startsWith("@");
          let argument = parts.start;
          if (waits) {
            add(line.from + parts.start, line.from + parts.code.length, "label");
            argument = parts.code.length;
          } else if (before) {
            for (let i = parts.start; i < parts.code.length; i++)
              if (known.has(parts.code[i])) add(line.from + i, line.from + i + 1, "command");
          } else if (parts.word) {
            add(line.from + parts.start, line.from + parts.start + parts.word.spelling.length, "command");
            argument += parts.word.spelling.length;
          }
          for (const match of parts.code.slice(argument).matchAll(/[A-Za-z_]\w{2,}|[+-]?\d+/g)) {
            const start = line.from + argument + match.index;
            if (/^[A-Za-z_]/.test(match[0])) {
              if (match[0] in self.labels) add(start, start + match[0].length, "label");
            } else add(start, start + match[0].length, "number");
          }
          if (parts.comment >= 0) add(line.from + parts.comment, line.to, "comment");
          at = line.to + 1;
        }
      }
      return CM.Decoration.set(builder, true);
    };
    return CM.ViewPlugin.fromClass(
      class {
        /** @param {any} view */
        constructor(view) {
          this.decorations = decorate(view);
        }
        /** @param {any} update */
        update(update) {
          if (update.docChanged || update.viewportChanged || update.transactions.some((/** @type {any} */ { effects }) => effects.length))
            this.decorations = decorate(update.view);
        }
      },
      { decorations: (/** @type {any} */ plugin) => plugin.decorations },
    );
  }

  /** @param {any} context */
  complete(context) {
    const line = context.state.doc.lineAt(context.pos),
      parts = this.parts(line.text);
    const at = context.pos - line.from;
    if (parts.comment >= 0 && at > parts.comment) return null;
    const { words, language } = this.facts;
    const typed = parts.code.slice(parts.start, at);
    const argument =
      parts.word && typed.startsWith(parts.word.spelling) ? typed.slice(parts.word.spelling.length) : null;
    if (language && argument) {
      const word = /[A-Za-z_]\w*$/.exec(argument);
      if (!word && !context.explicit) return null;
      const options = Object.entries(this.labels).map(([label, address]) => ({
        label,
        type: "variable",
        detail: `at ${address}`,
      }));
      return options.length ? { from: context.pos - (word ? word[0].length : 0), options, validFor: /^\w*$/ } : null;
    }
    if (!typed && !context.explicit) return null;
    if (/\s/.test(typed)) return null;
    const options = words.flatMap((word) =>
      word.rows
        .filter((row) => row.stored || !language)
        .slice(0, 1)
        .map((row) => ({
          label: word.spelling,
          type: "keyword",
          detail: row.what,
          info: () => sheet(word.rows, language),
          boost: word.spelling === typed ? 2 : 0,
        })),
    );
    return { from: line.from + parts.start, options, validFor: /^\S{0,3}$/ };
  }

  /**
   * @param {any} view
   * @param {number} at
   */
  help(view, at) {
    let message = "";
    view.state.field(this.errors.field).between(at, at, (/** @type {number} */ from, /** @type {number} */ to, /** @type {any} */ value) => {
      message = value.spec.message;
    });
    const line = view.state.doc.lineAt(at),
      parts = this.parts(line.text);
    const word =
      parts.word && at - line.from >= parts.start && at - line.from <= parts.start + parts.rest.trimEnd().length
        ? parts.word
        : null;
    if (!message && !word) return null;
    return {
      pos: line.from + parts.start,
      above: true,
      create: () => {
        const dom = document.createElement("div");
        dom.className = "cm-help";
        if (message) dom.append(paragraph(message, "cm-help-wrong"));
        if (word) dom.append(sheet(word.rows, this.facts.language));
        return { dom };
      },
    };
  }
}

/**
 * What the table says of a command.
 * @param {any[]} rows
 * @param {boolean} language
 */
export function sheet(rows, language) {
  const dom = document.createElement("div");
  dom.className = "cm-sheet";
  for (const row of rows) {
    dom.append(paragraph(row.form, "mono"), paragraph(row.what, ""));
    const facts = [
      row.takes && !/^no/.test(row.takes) ? `takes ${row.takes}` : "",
      language && row.bytes ? `${row.bytes} bytes` : "",
      row.section,
    ];
    dom.append(paragraph(facts.filter(Boolean).join(" \u00b7 "), "quiet"));
  }
  return dom;
}

/**
 * @param {string} text
 * @param {string} kind
 */
function paragraph(text, kind) {
  const made = document.createElement("p");
  made.className = kind;
  made.textContent = text;
  return made;
}

/**
 * Whether the line of a range was changed.
 * @param {any} transaction
 * @param {number} from
 * @param {number} to
 */
function touched(transaction, from, to) {
  const { doc } = transaction.state;
  let found = false;
  transaction.changes.iterChangedRanges((/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ begin, /** @type {number} */ end) => {
    found ||= doc.lineAt(begin).from <= to && from <= doc.lineAt(end).to;
  });
  return found;
}

/* A set of ranges that move with the text: {field, set}. Those that fade are gone when their line is changed. */
function ranges(fades = false) {
  const set = CM.StateEffect.define();
  const field = CM.StateField.define({
    create: () => CM.RangeSet.empty,
    /** @param {any} transaction */
    update(/** @type {any} */ value, /** @type {any} */ transaction) {
      value = value.map(transaction.changes);
      if (fades && transaction.docChanged) value = value.update({ filter: (/** @type {number} */ from, /** @type {number} */ to) => !touched(transaction, from, to) });
      for (const effect of transaction.effects) if (effect.is(set)) value = CM.RangeSet.of(effect.value, true);
      return value;
    },
  });
  return { field, set };
}

/** @type {any} */
let Dot = null;
/** @type {any} */
let Place = null;

/* Gutter markers are classes of CodeMirror's, which is loaded when it is needed. */
async function prepare() {
  CM ||= await import("nicegui-codemirror");
  Dot ||= class extends CM.GutterMarker {
    eq() {
      return true;
    }
    toDOM() {
      const dot = document.createElement("span");
      dot.className = "cm-dot";
      dot.title = "breakpoint";
      return dot;
    }
  };
  Place ||= class extends CM.GutterMarker {
    /**
     * @param {number} address
     * @param {number} bytes
     */
    constructor(address, bytes) {
      super();
      this.address = address;
      this.bytes = bytes;
    }
    /** @param {any} other */
    eq(other) {
      return other.address === this.address && other.bytes === this.bytes;
    }
    toDOM() {
      const place = document.createElement("span");
      place.textContent = String(this.address);
      place.title = `byte ${this.address}, ${this.bytes} byte${this.bytes === 1 ? "" : "s"}`;
      return place;
    }
  };
}
