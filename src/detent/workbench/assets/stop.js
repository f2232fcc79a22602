// One STOP above every page, and Esc twice, for everything that says it can be stopped (detent.workbench.stopping).

const { part, on, get, call, toast } = window.detent;
const TWICE = 700; // ms between two presses of Esc

async function stopAll() {
  document.dispatchEvent(new CustomEvent("detent-stop"));
  try {
    for (const one of await call("stop_all")) toast(`STOP: ${one}`);
  } catch (error) {
    toast(`STOP: ${error.message}`, "error");
  }
}

const able = () => (get("stop.able") || []).length > 0;

part("stop", (button) => {
  button.addEventListener("click", stopAll);
  return on("stop.able", () => {
    button.hidden = !able();
    document.documentElement.dataset.stop = able() ? "yes" : "";
  });
});

let last = 0;
addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat) return;
  const now = performance.now();
  if (now - last < TWICE && able()) {
    event.preventDefault();
    last = 0;
    stopAll();
  } else {
    last = now;
  }
}, true);
