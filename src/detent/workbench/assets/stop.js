// One STOP above every page, and Esc twice, for everything that says it can be stopped (detent.workbench.stopping).

import { ALL, Confirming } from "./confirming.js";
import { wordsOf } from "./forms.js";

const { part, on, get, call, toast } = window.detent;
const TWICE = 700; // ms between two presses of Esc
const SOON = 2500; // ms in which most stops are confirmed; who stands at the machine is told no later that one is not
const HELP = "If something moves, switch off the supply of its motor.";

const stops = new Confirming();

function show() {
  for (const box of document.querySelectorAll(".alarm.unconfirmed")) showIn(/** @type {HTMLElement} */ (box));
}

/** @param {HTMLElement} box */
function showIn(box) {
  const words = box.querySelector("span");
  if (words) words.textContent = stops.words;
  box.classList.toggle("shown", stops.words !== "");
}

async function stopAll() {
  document.dispatchEvent(new CustomEvent("detent-stop"));
  // a question that is open is answered by STOP: nothing of it is done
  for (const dialog of document.querySelectorAll("dialog")) if (dialog.open) dialog.close("");
  const stopping = call("stop_all");
  watch(ALL, stopping);
  for (const one of await stopping.catch(() => [])) toast(`STOP: ${one}`);
}

/** Whether the workbench can be heard: a STOP is not confirmed for long, then, and that is told at once. */
const heard = () => document.documentElement.dataset.link === "up" && !document.documentElement.dataset.mute;

/**
 * Tell whoever stands at the machine that a stop is not confirmed: soon, and until it is, or has been seen.
 * @param {string} who
 * @param {Promise<any>} stopping
 */
async function watch(who, stopping) {
  const mine = stops.begin(who);
  const name = who === ALL ? "STOP" : `STOP of ${who}`;
  const late = setTimeout(() => {
    stops.tell(who, mine, `${name} is not confirmed yet. ${HELP}`);
    show();
  }, heard() ? SOON : 0);
  try {
    await stopping;
    stops.done(who, mine);
  } catch (error) {
    const words = wordsOf(error);
    stops.tell(who, mine, `${name}: ${words}${/switch off the supply/.test(words) ? "" : `. ${HELP}`}`);
  } finally {
    clearTimeout(late);
    show();
  }
}

// the STOP of a single unit, and a key that is let go
document.addEventListener("detent-stopping", (event) => {
  const { who, stopping } = /** @type {CustomEvent} */ (event).detail;
  watch(who, stopping);
});

const able = () => (get("stop.able") || []).length > 0;

part("stop", (button) => {
  button.addEventListener("click", stopAll);
  return on("stop.able", () => {
    button.hidden = !able();
    document.documentElement.dataset.stop = able() ? "yes" : "";
  });
});

part("unconfirmed", (box) => {
  box.querySelector("[data-close]").addEventListener("click", () => {
    stops.seen();
    show();
  });
  showIn(box);
});

let last = -TWICE;
addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat) return;
  const now = event.timeStamp; // when it was pressed, however busy the page has been since
  if (now - last < TWICE && able()) {
    event.preventDefault();
    last = -TWICE;
    stopAll();
  } else {
    last = now;
  }
}, true);
