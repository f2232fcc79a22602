// One STOP above every page, and Esc twice, for everything that says it can be stopped (detent.workbench.stopping).

import { wordsOf } from "./forms.js";

const { part, on, get, call, toast } = window.detent;
const TWICE = 700; // ms between two presses of Esc
const SOON = 2500; // ms in which most stops are confirmed; who stands at the machine is told no later that one is not
const HELP = "If something moves, switch off the supply of its motor.";

let told = ""; // what stands above the page until somebody has seen it
let pressed = 0;

/** @param {string} text */
function tell(text) {
  told = text;
  for (const box of document.querySelectorAll(".alarm.unconfirmed")) show(/** @type {HTMLElement} */ (box));
}

/** @param {HTMLElement} box */
function show(box) {
  const words = box.querySelector("span");
  if (words) words.textContent = told;
  box.classList.toggle("shown", told !== "");
}

async function stopAll() {
  document.dispatchEvent(new CustomEvent("detent-stop"));
  // a question that is open is answered by STOP: nothing of it is done
  for (const dialog of document.querySelectorAll("dialog")) if (dialog.open) dialog.close("");
  const stopping = call("stop_all");
  watch(stopping);
  for (const one of await stopping.catch(() => [])) toast(`STOP: ${one}`);
}

/**
 * Tell whoever stands at the machine that a stop is not confirmed: soon, and until it is, or has been seen.
 * @param {Promise<any>} stopping
 */
async function watch(stopping) {
  const mine = (pressed += 1);
  const late = setTimeout(() => mine === pressed && tell(`STOP is not confirmed yet. ${HELP}`), SOON);
  try {
    await stopping;
    if (mine === pressed) tell("");
  } catch (error) {
    const words = wordsOf(error);
    if (mine === pressed) tell(`STOP: ${words}${/switch off the supply/.test(words) ? "" : `. ${HELP}`}`);
  } finally {
    clearTimeout(late);
  }
}

// the STOP of a single unit, and a key that is let go
document.addEventListener("detent-stopping", (event) => watch(/** @type {CustomEvent} */ (event).detail));

const able = () => (get("stop.able") || []).length > 0;

part("stop", (button) => {
  button.addEventListener("click", stopAll);
  return on("stop.able", () => {
    button.hidden = !able();
    document.documentElement.dataset.stop = able() ? "yes" : "";
  });
});

part("unconfirmed", (box) => {
  box.querySelector("[data-close]").addEventListener("click", () => tell(""));
  show(box);
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
