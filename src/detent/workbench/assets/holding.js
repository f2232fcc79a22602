// A key that is held: the axis runs as long as it is, and stops when it is let go, or its window is out of sight.

const { call, asking, failed } = window.detent;
const HELD = 300; // ms between two words that a key is held

/**
 * Make `buttons` run the unit `name()` at `rate(button)`, in steps/s with its sign, null for a rate that is none.
 * `sent(lines, who)` is told what was sent, `stopped(who, promise)` of the stop when the key is let go. Returns {letGo, end}:
 * `letGo(stop)` lets go of a key that is held, and stops the axis unless `stop` is false; `end` is for the end of the page.
 * @param {Part[]} buttons
 * @param {{name: () => string, rate: (button: Part) => number | null, sent: (lines: string[], who: string) => void,
 *   stopped: (who: string, stopping: Promise<string>) => void}} told
 */
export function holding(buttons, { name, rate, sent, stopped }) {
  let timer = 0;
  let held = "";

  function letGo(stop = true) {
    if (!timer) return;
    clearInterval(timer);
    timer = 0;
    for (const one of buttons) one.classList.remove("down");
    if (stop) stopped(held, call("unit_stop", held));
  }

  /** @param {Part} button */
  async function hold(button) {
    if (timer || button.disabled) return;
    const speed = rate(button);
    if (speed === null) return;
    button.classList.add("down");
    held = name();
    const ask = asking(); // a key that somebody has stopped does not hold what is begun after that
    const mine = (timer = setInterval(() => ask("unit_held", held).catch(() => {}), HELD));
    try {
      const lines = await ask("unit_hold", held, speed);
      if (timer === mine) sent(lines, held);
    } catch (error) {
      if (timer !== mine) return;
      letGo(false);
      failed(error);
    }
  }

  for (const button of buttons) {
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      try {
        button.setPointerCapture(event.pointerId);
      } catch {
        /* a pointer that is gone already */
      }
      hold(button);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(end, () => letGo());
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      event.stopPropagation(); // a space is the key's, and does not pause the cell
      if (!event.repeat) hold(button);
    });
    button.addEventListener("keyup", (event) => {
      if (event.key === " " || event.key === "Enter") letGo();
    });
  }
  const away = () => letGo();
  const hidden = () => document.hidden && letGo();
  const noMore = () => letGo(false); // STOP does it
  addEventListener("blur", away);
  addEventListener("pagehide", away);
  document.addEventListener("visibilitychange", hidden);
  document.addEventListener("detent-stop", noMore);
  return {
    letGo,
    end() {
      letGo();
      removeEventListener("blur", away);
      removeEventListener("pagehide", away);
      document.removeEventListener("visibilitychange", hidden);
      document.removeEventListener("detent-stop", noMore);
    },
  };
}
