// What every page of the workbench shares: the live table and the markup bound to it, calls, help, theme, keyboard.
// The conventions are told in detent/workbench/pages/__init__.py.

import { FORMS, grouped, seconds, wordsOf } from "./forms.js";
import { Meanings } from "./meanings.js";
import { Silence } from "./silence.js";

/** @type {Map<string, any>} the live table, as far as this window knows it */
const values = new Map();
/** @type {Map<string, Set<[HTMLElement, string]>>} key -> elements that show it, and how */
const bound = new Map();
/** @type {[string, Heard][]} prefix, function */
const listeners = [];
/** @type {Set<() => void>} */
const frames = new Set();
/** @type {Map<string, Setup>} */
const parts = new Map();
/** @type {Map<HTMLElement, End>} element with data-part -> what ends it */
const living = new Map();
/** @type {Map<number, [(value: any) => void, (error: Error) => void]>} number of a call -> who waits for it */
const waiting = new Map();
const meanings = new Meanings((key) => values.get(key));
/** @type {(() => void)[]} what is called when there is a connection */
const opening = [];
const PATIENCE = 8000; // ms that a call waits for one
const MUTE = 3000; // ms without a word of the server, which speaks every second, until a person is told
const GIVEN_UP = 20000; // ms: then a new connection is tried, as this one may have been lost on its way
/** @type {WebSocket | null} */
let socket = null;
/** @type {number | null} the clock of the server, as it was heard last: it does nothing late that moves something */
let beat = null;
/** What stops something; the server counts those of this window likewise. */
const STOPS = new Set(["stop_all", "unit_stop", "stop_motors"]);
let own = 0; // stops that were called on this socket
const silence = new Silence(MUTE, performance.now());
let calls = 0;
let pause = 250; // ms before the next attempt to connect

// -- the socket -----------------------------------------------------------------------------------------

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const mine = (socket = new WebSocket(`${scheme}//${location.host}/live`));
  mine.onopen = () => {
    pause = 250;
    own = 0;
    silence.heard(performance.now());
    document.documentElement.dataset.link = "up";
    for (const go of opening.splice(0)) go();
  };
  mine.onmessage = (event) => {
    silence.heard(performance.now());
    const told = JSON.parse(event.data);
    if ("beat" in told) beat = told.beat;
    const asked = waiting.get(told.id);
    if (told.set) take(told.set);
    else if (asked) {
      const [resolve, reject] = asked;
      waiting.delete(told.id);
      if ("error" in told) reject(new Error(told.error));
      else resolve(told.value);
    }
  };
  mine.onclose = () => mine === socket && lost();
}

function lost() {
  socket = null;
  document.documentElement.dataset.link = "down";
  for (const [, reject] of waiting.values()) reject(new Error("the workbench does not answer"));
  waiting.clear();
  setTimeout(connect, pause);
  pause = Math.min(pause * 2, 4000);
}

function listenForSilence() {
  const passed = socket && socket.readyState === WebSocket.OPEN ? silence.look(performance.now()) : 0;
  document.documentElement.dataset.mute = passed ? "yes" : "";
  for (const words of all(".alarm.mute b:first-child")) words.textContent = String(Math.round(passed / 1000));
  if (passed > GIVEN_UP) {
    socket?.close();
    lost();
  }
}

/**
 * Make a call; it waits a while for the connection, if there is none.
 * @type {Detent["call"]}
 */
const call = (name, ...args) => asking()(name, ...args);

/**
 * Calls that belong together: whoever begins them knows the stops up to now. Of what moves nothing is done behind a later
 * one, in whichever window it was pressed.
 * @type {Detent["asking"]}
 */
function asking() {
  const known = { stops: values.get("stop.count") ?? 0, own, socket };
  return (name, ...args) => (name in STANDS ? meanings.make("held", STANDS[name], () => say(name, args, known)) : say(name, args, known));
}

/**
 * @param {string} name
 * @param {any[]} args
 * @param {{stops: number, own: number, socket: WebSocket | null}} known
 * @returns {Promise<any>}
 */
async function say(name, args, known) {
  if (!socket || socket.readyState !== WebSocket.OPEN) await connected();
  const stops = [known.stops, known.socket === socket ? known.own : 0];
  if (STOPS.has(name)) own += 1;
  return new Promise((resolve, reject) => {
    calls += 1;
    waiting.set(calls, [resolve, reject]);
    socket?.send(JSON.stringify({ call: name, args, id: calls, heard: beat, stops }));
  });
}

/** @returns {Promise<void>} kept when there is a connection */
function connected() {
  return new Promise((resolve, reject) => {
    const late = setTimeout(() => reject(new Error("the workbench does not answer")), PATIENCE);
    opening.push(() => {
      clearTimeout(late);
      resolve();
    });
  });
}

// -- what is meant -----------------------------------------------------------------------------------------
// The table is a moment behind what was clicked. Whoever turns something over asks what it is meant to be: then the
// second of two quick clicks takes the first one back, and none is lost.

/** @type {Record<string, boolean>} */
const STANDS = { hold: true, go: false, step_event: true, step_back: true, step_instruction: true, rewind: true, program_run_to: false };

/** Time stands if it goes, and goes if it stands. */
const turnTime = () => action(meanings.of("held") ? "go" : "hold");

/**
 * The same for a hand at the page: an error is shown, and nothing is thrown.
 * @type {Detent["action"]}
 */
async function action(name, ...args) {
  try {
    return await call(name, ...args);
  } catch (error) {
    failed(error);
    return null;
  }
}

// -- the table ------------------------------------------------------------------------------------------

/** @param {Record<string, any>} changed */
function take(changed) {
  for (const [key, value] of Object.entries(changed)) {
    values.set(key, value);
    const there = bound.get(key);
    if (there) {
      for (const one of there) {
        if (one[0].isConnected) show(one[0], one[1], value);
        else there.delete(one);
      }
    }
    for (const [prefix, heard] of listeners) if (key.startsWith(prefix)) heard(key, value);
  }
  for (const drawn of frames) drawn();
}

const KINDS = ["live", "level", "var", "pressed"];

/**
 * @param {HTMLElement} element
 * @param {string} kind one of KINDS
 * @param {any} value
 */
function show(element, kind, value) {
  switch (kind) {
    case "live": {
      const form = FORMS[element.dataset.form || "plain"] || FORMS.plain;
      const text = form(value);
      if (element.textContent !== text) element.textContent = text;
      break;
    }
    case "level":
      element.dataset.value = value === null ? "" : String(value);
      break;
    case "var":
      element.style.setProperty("--value", value === null ? "0" : value);
      break;
    case "pressed":
      element.setAttribute(element.getAttribute("role") === "switch" ? "aria-checked" : "aria-pressed", value ? "true" : "false");
      break;
  }
}

/** @param {HTMLElement} element */
function bind(element) {
  for (const kind of KINDS) {
    const key = element.dataset[kind];
    if (!key) continue;
    const there = bound.get(key) || new Set();
    there.add([element, kind]);
    bound.set(key, there);
    if (values.has(key)) show(element, kind, values.get(key));
  }
}

const SELECTOR = KINDS.map((kind) => `[data-${kind}]`).join(",");

/** @param {HTMLElement} root */
function appear(root) {
  if (root.matches(SELECTOR)) bind(root);
  for (const element of all(SELECTOR, root)) bind(element);
  if (root.matches("[data-part]")) begin(root);
  for (const element of all("[data-part]", root)) begin(element);
}

/**
 * The elements in `root` that a selector names.
 * @param {string} selector
 * @param {ParentNode} root
 * @returns {NodeListOf<HTMLElement>}
 */
const all = (selector, root = document) => root.querySelectorAll(selector);

/** @param {HTMLElement} element */
function begin(element) {
  const setup = parts.get(element.dataset.part || "");
  if (setup && !living.has(element)) living.set(element, setup(/** @type {Part} */ (element)) || (() => {}));
}

function watchDocument() {
  /** @param {MutationRecord[]} records */
  const look = (records) => {
    let gone = false;
    for (const record of records) {
      for (const node of record.addedNodes) if (node.nodeType === 1) appear(/** @type {HTMLElement} */ (node));
      gone = gone || record.removedNodes.length > 0;
    }
    if (gone) {
      for (const [element, end] of living) {
        if (!element.isConnected) {
          living.delete(element);
          end();
        }
      }
    }
  };
  new MutationObserver(look).observe(document.documentElement, { childList: true, subtree: true });
  appear(document.documentElement);
}

/** @type {Detent["part"]} */
function part(name, setup) {
  parts.set(name, setup);
  for (const element of all(`[data-part="${name}"]`)) begin(element);
}

/** @type {Detent["on"]} */
function on(prefix, heard) {
  /** @type {[string, Heard]} */
  const entry = [prefix, heard];
  listeners.push(entry);
  for (const [key, value] of values) if (key.startsWith(prefix)) heard(key, value);
  return () => listeners.splice(listeners.indexOf(entry), 1);
}

/** @type {Detent["frame"]} */
function frame(drawn) {
  frames.add(drawn);
  return () => frames.delete(drawn);
}

// -- help, messages -------------------------------------------------------------------------------------

/** @type {HTMLElement | null} */
let helpBox = null;
/** @type {HTMLElement | null} */
let helped = null;
let helpSoon = 0;

/** @param {HTMLElement} element */
function showHelp(element) {
  const text = element.dataset.help;
  if (!text || !element.isConnected || document.querySelector(".tour")) return;
  if (!helpBox) {
    helpBox = document.createElement("div");
    helpBox.className = "help";
    helpBox.setAttribute("role", "tooltip");
    helpBox.id = "help";
    document.body.append(helpBox);
  }
  helped = element;
  element.setAttribute("aria-describedby", "help");
  helpBox.textContent = text;
  helpBox.classList.add("shown");
  const at = element.getBoundingClientRect();
  const mine = helpBox.getBoundingClientRect();
  const left = Math.max(8, Math.min(at.left + at.width / 2 - mine.width / 2, innerWidth - mine.width - 8));
  const above = at.top - mine.height - 8;
  helpBox.style.left = `${Math.round(left)}px`;
  helpBox.style.top = `${Math.round(above > 4 ? above : at.bottom + 8)}px`;
}

function hideHelp() {
  clearTimeout(helpSoon);
  if (helped) helped.removeAttribute("aria-describedby");
  if (helpBox) helpBox.classList.remove("shown");
  helped = null;
}

/**
 * The element that an event comes from.
 * @param {Event} event
 * @returns {any}
 */
const origin = (event) => event.target;

function listenForHelp() {
  document.addEventListener("pointerover", (event) => {
    const element = origin(event).closest && origin(event).closest("[data-help]");
    if (element === helped) return;
    hideHelp();
    if (element && event.pointerType === "mouse") helpSoon = setTimeout(() => showHelp(element), 350);
  });
  document.addEventListener("pointerdown", (event) => {
    hideHelp();
    const element = origin(event).closest("[data-help]");
    if (element && event.pointerType !== "mouse") helpSoon = setTimeout(() => showHelp(element), 500);
  });
  document.addEventListener("pointerup", () => clearTimeout(helpSoon));
  document.addEventListener("scroll", hideHelp, true);
  document.addEventListener("focusin", (event) => {
    const element = origin(event).closest("[data-help]");
    if (element && origin(event).matches(":focus-visible")) showHelp(element);
  });
  document.addEventListener("focusout", hideHelp);
}

/** @type {Detent["toast"]} */
function toast(text, kind = "note") {
  let shelf = document.getElementById("toasts");
  if (!shelf) {
    shelf = document.createElement("div");
    shelf.id = "toasts";
    shelf.setAttribute("role", "status");
    shelf.setAttribute("aria-live", "polite");
    document.body.append(shelf);
  }
  for (const old of shelf.children) if (old.textContent === text) old.remove();
  const one = document.createElement("div");
  one.className = `toast ${kind}`;
  one.textContent = text;
  one.addEventListener("click", () => one.remove());
  shelf.append(one);
  while (shelf.children.length > 4) shelf.firstChild?.remove();
  setTimeout(() => one.remove(), kind === "error" ? 9000 : 4000);
}

/** @type {Detent["failed"]} */
function failed(error) {
  toast(wordsOf(error), "error");
}

// -- actions by hand --------------------------------------------------------------------------------------

/** @param {any} written */
function argument(written) {
  if (typeof written !== "string") return written;
  if (written.startsWith("!")) return meanings.of(written.slice(1)) ? 0 : 1;
  if (written.startsWith("=")) return values.get(written.slice(1));
  return written;
}

function listenForActions() {
  document.addEventListener("click", (event) => {
    const element = origin(event).closest("[data-do]");
    if (!element || element.disabled) return;
    /** @type {any[]} */
    const written = JSON.parse(element.dataset.args || "[]");
    const args = written.map(argument);
    const turned = written.findIndex((one) => typeof one === "string" && one.startsWith("!"));
    if (turned < 0) action(element.dataset.do, ...args);
    else meanings.make(written[turned].slice(1), args[turned], () => action(element.dataset.do, ...args));
  });
  document.addEventListener("click", (event) => {
    // a pointer does not leave the focus at a button or tab, where the next space would press it once more
    if (event.detail > 0) origin(event).closest("button, a")?.blur();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "F8" || event.defaultPrevented || event.ctrlKey || event.altKey || event.shiftKey) return;
    event.preventDefault(); // wherever the focus is
    if (!event.repeat) turnTime();
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = origin(event);
    if (at.closest("input, textarea, select, [contenteditable], .cm-editor, [role=dialog]")) return;
    /** @type {Record<string, "step_event" | "step_back" | "slower" | "faster">} */
    const keys = { ".": "step_event", ",": "step_back", "[": "slower", "]": "faster" };
    if (event.key === " ") {
      if (at.closest("button, a, summary")) return; // it is theirs
      event.preventDefault();
      turnTime();
    } else if (event.key in keys) {
      event.preventDefault();
      if (!event.repeat || event.key === "." || event.key === ",") action(keys[event.key]);
    } else if (event.key === "?") {
      document.dispatchEvent(new CustomEvent("detent-tour"));
    } else if (/^[1-9]$/.test(event.key)) {
      all("nav.tabs a")[Number(event.key) - 1]?.click();
    }
  });
}

// -- theme, tabs ----------------------------------------------------------------------------------------

/** @type {((theme: "dark" | "light") => void)[]} */
const themed = [];
const darkOutside = matchMedia("(prefers-color-scheme: dark)");

/** @type {Detent["remembered"]} */
function remembered(name) {
  try {
    return localStorage.getItem(`detent.${name}`);
  } catch {
    return null; // a browser that keeps nothing
  }
}

/** @type {Detent["remember"]} */
function remember(name, value) {
  try {
    localStorage.setItem(`detent.${name}`, value);
  } catch {
    /* then it is asked again next time */
  }
}

function theme() {
  const chosen = remembered("theme");
  return chosen === "light" || chosen === "dark" ? chosen : darkOutside.matches ? "dark" : "light";
}

function applyTheme() {
  const now = theme();
  document.documentElement.dataset.theme = now;
  if (window.Quasar) window.Quasar.Dark.set(now === "dark");
  for (const heard of themed) heard(now);
}

/** @type {Detent["onTheme"]} */
function onTheme(heard) {
  themed.push(heard);
  heard(theme());
  return () => themed.splice(themed.indexOf(heard), 1);
}

function markTab() {
  for (const tab of document.querySelectorAll("nav.tabs a")) {
    const here = tab.getAttribute("href") === location.pathname;
    if (here) tab.setAttribute("aria-current", "page");
    else tab.removeAttribute("aria-current");
  }
  /** @type {HTMLElement | null} */
  const here = document.querySelector("nav.tabs a[aria-current]");
  here?.scrollIntoView({ block: "nearest", inline: "center" }); // on a phone the tabs are wider than the window
  const title = document.documentElement.dataset.title || "Detent";
  document.title = here ? `${here.dataset.name} \u2013 ${title}` : title;
}

function followTabs() {
  for (const name of /** @type {("pushState" | "replaceState")[]} */ (["pushState", "replaceState"])) {
    const before = history[name];
    /** @param {[any, string, (string | URL | null)?]} args */
    history[name] = function (...args) {
      const result = before.apply(this, args);
      markTab();
      return result;
    };
  }
  addEventListener("popstate", markTab);
  part("tabs", markTab);
  part("theme", (button) => {
    button.addEventListener("click", () => {
      remember("theme", theme() === "dark" ? "light" : "dark");
      applyTheme();
    });
  });
  part("restart", (button) => {
    let armed = 0;
    const rest = () => {
      armed = 0;
      button.classList.remove("armed");
    };
    button.addEventListener("click", () => {
      if (!armed) {
        armed = setTimeout(rest, 3000);
        button.classList.add("armed");
        toast("Click once more to begin anew: the past and what is in memory are lost, drafts and EEPROMs are not.");
        return;
      }
      clearTimeout(armed);
      rest();
      action("restart");
    });
  });
  part("pace", (select) => {
    select.addEventListener("change", () => action("pace", select.value === "max" ? null : Number(select.value)));
    return on("pace", (key, value) => {
      if (key !== "pace") return;
      const text = value === null ? "max" : String(value);
      let choice = [...select.options].find((option) => option.value === text);
      if (!choice) {
        choice = new Option(FORMS.pace(value), text);
        select.add(choice, 0);
      }
      select.value = text;
    });
  });
}

window.detent = {
  part, on, frame, call, asking, action, turnTime, toast, failed, onTheme, theme, remembered, remember, seconds, grouped,
  meant: (key, now = values.get(key)) => meanings.of(key, now),
  underWay: (key) => meanings.underWay(key),
  make: (key, value, going) => meanings.make(key, value, going),
  turning: () => meanings.any,
  get: (/** @type {string} */ key) => values.get(key),
  keys: () => values.keys(),
  forms: FORMS,
};

darkOutside.addEventListener("change", applyTheme);
addEventListener("load", applyTheme);
applyTheme();
listenForHelp();
listenForActions();
followTabs();
on("real", (key, value) => {
  if (key === "real") document.documentElement.dataset.real = value ?? "";
});
on("silent", (key, value) => (document.documentElement.dataset.silent = value ? "yes" : ""));
on("crashed", (key, value) => (document.documentElement.dataset.crashed = value ? "yes" : ""));
on("title", (key, value) => {
  document.documentElement.dataset.title = value;
  markTab();
});
watchDocument();
connect();
setInterval(listenForSilence, 1000);
