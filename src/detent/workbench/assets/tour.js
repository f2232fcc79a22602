// The guided tour: a few stops, dismissed with a key or a click, and remembered.

const { get, part, remember, remembered } = window.detent;

const STOPS = [
  ["", "Welcome to the workbench", "A cell of controllers, as they stand now: running, ready, or waiting to be spoken to. Everything here is live, and everything can be taken back. Six short stops."],
  [".unit .panel-head", "Every unit is a front panel", "Its power switch, its state, its position and rate, the instruction it is at, the last error. Lamps are the levels of its pins; hover over anything for what it is."],
  [".panel-switches, .toggle, button.pin", "Switches, inputs, wires", "Click a switch, an input pin or a strap to change it. Lines are the wires of the cell: green carries a 1."],
  [".transport", "Time obeys you", "Pause, go on by single events, and run from a thousandth of real time to as fast as it goes. Keys: space, comma and point, [ and ]."],
  [".history", "Drag back", "The whole past is kept. Drag the time line back, and the cell is as it was then; press go, and it goes on from there. What had come after is kept as another future."],
  ["nav.tabs", "And further", "Program: write, load and step a stored program. Terminal: every byte on the lines, explained. Scope and Motion: what the axes do, exact to the pulse."],
];

// where a machine hangs on real pins, some of this is otherwise
/** @type {Record<string, string>} */
const REAL = {
  "Welcome to the workbench": "The controllers of a machine on real pins, as they stand now. What you do here is done there, and nothing of it is taken back; STOP, above every page, stops every board at once. Six short stops.",
  "Switches, inputs, wires": "Click a strap or an input without a wire to change it. Inputs of a board have the level of their pins, and only a hand at the machine changes it.",
  "Time obeys you": "The machine's time goes on. Pause lets the view stand, and single events can be looked at. Keys: space, comma and point.",
  "Drag back": "The past is kept. Drag the time line back, and you see the cell as it was then; the machine goes on meanwhile. Press go, and you are at its present again.",
};

// where a real unit is connected, the cell is the same model by the book
/** @type {Record<string, string>} */
const CONNECTED = {
  "Welcome to the workbench": "This page shows a cell of controllers that is computed. The real unit that is connected is on the page Unit: what is done there is done, and is not taken back. STOP, above every page, stops it. Six short stops.",
  "Drag back": "The whole past of the cell is kept. Drag the time line back, and the cell is as it was then; press go, and it goes on from there. A real unit knows no way back: its time goes on.",
};

/** What a stop of the tour says where we are. */
const said = (/** @type {string} */ title, /** @type {string} */ text) => {
  const outside = (get("r.names") || []).some((/** @type {string} */ name) => !name.endsWith(" (cell)"));
  return (get("real") && REAL[title]) || (outside && CONNECTED[title]) || text;
};

/** @type {{box: Part, spot: HTMLElement} | null} what is on the page while the tour is */
let shown = null;
let at = 0;

function end() {
  remember("tour", "seen");
  shown?.box.remove();
  shown?.spot.remove();
  shown = null;
}

function show() {
  if (!shown) return;
  const { box, spot } = shown;
  const [selector, title, text] = STOPS[at];
  const target = selector ? document.querySelector(selector) : null;
  box.querySelector("h2").textContent = title;
  box.querySelector("p").textContent = said(title, text);
  box.querySelector(".count").textContent = `${at + 1} of ${STOPS.length}`;
  box.querySelector(".next").textContent = at + 1 < STOPS.length ? "Next" : "Done";
  box.querySelector(".before").style.visibility = at ? "visible" : "hidden";
  if (target) target.scrollIntoView({ block: "nearest" });
  const mine = box.getBoundingClientRect();
  let left = (innerWidth - mine.width) / 2;
  let top = Math.max(60, (innerHeight - mine.height) / 2 - 40);
  if (target) {
    const there = target.getBoundingClientRect();
    spot.style.cssText = `left:${there.left - 4}px;top:${there.top - 4}px;width:${there.width + 8}px;height:${there.height + 8}px`;
    left = Math.max(12, Math.min(there.left, innerWidth - mine.width - 12));
    top = there.bottom + mine.height + 16 < innerHeight ? there.bottom + 12 : Math.max(12, there.top - mine.height - 12);
  } else spot.style.cssText = "left:50%;top:-20px;width:0;height:0";
  box.style.left = `${left}px`;
  box.style.top = `${top}px`;
  box.querySelector(".next").focus({ preventScroll: true });
}

function start() {
  if (shown) return;
  at = 0;
  const spot = document.createElement("div");
  spot.className = "tour-spot";
  const box = /** @type {Part} */ (document.createElement("section"));
  box.className = "tour";
  box.setAttribute("role", "dialog");
  box.setAttribute("aria-label", "Guided tour");
  box.innerHTML = `<h2></h2><p></p><div class="row"><button class="key small bare skip">Skip</button><span class="quiet count"></span>
    <span class="row"><button class="key small before">Back</button><button class="key small primary next"></button></span></div>`;
  document.body.append(spot, box);
  shown = { box, spot };
  box.querySelector(".skip").addEventListener("click", end);
  box.querySelector(".before").addEventListener("click", () => {
    at -= 1;
    show();
  });
  box.querySelector(".next").addEventListener("click", () => {
    at += 1;
    if (at < STOPS.length) show();
    else end();
  });
  box.addEventListener("keydown", (event) => {
    if (event.key === "Escape") end();
  });
  show();
}

document.addEventListener("detent-tour", start);
part("tour-button", (button) => {
  button.addEventListener("click", start);
  if (remembered("tour") !== "seen" && location.pathname === "/") setTimeout(start, 600); // when the page stands
});
