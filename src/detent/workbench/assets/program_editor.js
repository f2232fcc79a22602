/* The editor of the Program page: CodeMirror, as NiceGUI brings it, told the language of a unit from the table of its
   controller: colours, completion, help, errors, addresses, breakpoints and the line that runs. */

let CM = null;

/* The editor in `place`. `told` has changed(typed), toggled(line), keys {key: action}. */
export async function makeEditor(place, told) {
  await prepare();
  return new Editor(place, told);
}

class Editor {
  constructor(place, told) {
    this.told = told;
    this.facts = { words: [], comment: ";", language: true };
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

  /* Show another text; nobody has typed it. */
  set(text) {
    this.quiet = true;
    this.view.dispatch({
      changes: { from: 0, to: this.view.state.doc.length, insert: text },
      selection: { anchor: 0 },
    });
    this.quiet = false;
  }

  /* Take the language of a unit (what `program_about` gave). */
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

  /* What `program_check` found. */
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
            .filter(({ from, to }) => to > from),
        ),
      ],
    });
  }

  breakAt(lines) {
    const { doc } = this.view.state;
    this.view.dispatch({
      effects: this.breakpoints.set.of(
        lines.filter((line) => line <= doc.lines).map((line) => new Dot().range(doc.line(line).from)),
      ),
    });
  }

  get breakLines() {
    const lines = [],
      { doc } = this.view.state;
    for (const cursor = this.view.state.field(this.breakpoints.field).iter(); cursor.value; cursor.next())
      lines.push(doc.lineAt(cursor.from).number);
    return [...new Set(lines)];
  }

  /* The line that runs (null: none), whether it stands there, and the lines that differ from memory. */
  spot(running, stands, different) {
    const { doc } = this.view.state,
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

  reveal(line) {
    const { doc } = this.view.state;
    if (line <= doc.lines)
      this.view.dispatch({ effects: CM.EditorView.scrollIntoView(doc.line(line).from, { y: "nearest", yMargin: 60 }) });
  }

  goTo(line, column = 1) {
    const { doc } = this.view.state,
      { from, to } = doc.line(Math.min(line, doc.lines));
    this.view.dispatch({ selection: { anchor: Math.min(from + column - 1, to) }, scrollIntoView: true });
    this.view.focus();
  }

  /* -- how it is made --------------------------------------------------------------------------------------- */

  extensions() {
    this.language = new CM.Compartment();
    const data = [{ autocomplete: (context) => this.complete(context) }]; // one and the same: a new one begins anew
    const toggle = (view, line) => {
      this.told.toggled(view.state.doc.lineAt(line.from).number);
      return true;
    };
    const changes = CM.EditorView.updateListener.of((update) => {
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
        markers: (view) => view.state.field(this.breakpoints.field),
        initialSpacer: () => new Dot(),
        domEventHandlers: { mousedown: toggle },
      }),
      CM.basicSetup,
      CM.gutter({
        class: "cm-addresses",
        markers: (view) => view.state.field(this.addresses.field),
        initialSpacer: () => new Place(1000, 4),
        domEventHandlers: { mousedown: toggle },
      }),
      CM.EditorView.decorations.from(this.errors.field),
      CM.EditorView.decorations.from(this.spots.field),
      CM.EditorState.languageData.of(() => data),
      CM.hoverTooltip((view, at) => this.help(view, at), { hoverTime: 250 }),
      this.language.of([]),
      changes,
      CM.EditorView.contentAttributes.of({ tabindex: "0" }),
      CM.EditorView.theme({ "&": { height: "100%" }, ".cm-scroller": { overflow: "auto" } }),
    ];
  }

  /* A line cut into labels, command and comment. */
  parts(text) {
    const { comment, words, language } = this.facts;
    const end = text.indexOf(comment),
      code = end < 0 ? text : text.slice(0, end);
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

  colours() {
    const self = this,
      { language, words } = this.facts;
    const before = !language && !words.some(({ whole }) => whole); // the value stands before its command
    const mark = (kind) => CM.Decoration.mark({ class: kind });
    const kinds = {
      command: mark("cm-command"),
      label: mark("cm-label"),
      number: mark("cm-number"),
      comment: mark("cm-note"),
    };
    const known = new Set(words.map(({ spelling }) => spelling));
    const decorate = (view) => {
      const builder = [];
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
        constructor(view) {
          this.decorations = decorate(view);
        }
        update(update) {
          if (update.docChanged || update.viewportChanged || update.transactions.some(({ effects }) => effects.length))
            this.decorations = decorate(update.view);
        }
      },
      { decorations: (plugin) => plugin.decorations },
    );
  }

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

  help(view, at) {
    let message = null;
    view.state.field(this.errors.field).between(at, at, (from, to, value) => {
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

/* What the table says of a command. */
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

function paragraph(text, kind) {
  const made = document.createElement("p");
  made.className = kind;
  made.textContent = text;
  return made;
}

/* Whether the line of a range was changed. */
function touched(transaction, from, to) {
  const { doc } = transaction.state;
  let found = false;
  transaction.changes.iterChangedRanges((a, b, begin, end) => {
    found ||= doc.lineAt(begin).from <= to && from <= doc.lineAt(end).to;
  });
  return found;
}

/* A set of ranges that move with the text: {field, set}. Those that fade are gone when their line is changed. */
function ranges(fades = false) {
  const set = CM.StateEffect.define();
  const field = CM.StateField.define({
    create: () => CM.RangeSet.empty,
    update(value, transaction) {
      value = value.map(transaction.changes);
      if (fades && transaction.docChanged) value = value.update({ filter: (from, to) => !touched(transaction, from, to) });
      for (const effect of transaction.effects) if (effect.is(set)) value = CM.RangeSet.of(effect.value, true);
      return value;
    },
  });
  return { field, set };
}

let Dot = null,
  Place = null;

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
    constructor(address, bytes) {
      super();
      this.address = address;
      this.bytes = bytes;
    }
    eq(other) {
      return other.address === this.address && other.bytes === this.bytes;
    }
    toDOM() {
      const place = document.createElement("span");
      place.textContent = this.address;
      place.title = `byte ${this.address}, ${this.bytes} byte${this.bytes === 1 ? "" : "s"}`;
      return place;
    }
  };
}
