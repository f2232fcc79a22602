// The time line: everything that is kept of the cell's past, with its marks. Dragging takes the cell there.

import { pitch, wordsOf } from "./forms.js";

const { part, on, frame, call, failed, seconds, get, turnTime } = window.detent;

/** @type {Record<string, string>} */
const COLOURS = { error: "#ff6b5e", caution: "#ffd84d", power: "#ffb02e", action: "#7fe3d0", breakpoint: "#ff8ad0", stored: "#8fb8ff" };
const LEFT = 10; // px of air at both ends

part("timeline", (box) => {
  const canvas = document.createElement("canvas");
  const tag = document.createElement("div");
  tag.className = "tag";
  box.append(canvas, tag);
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  /** @type {[number, string, string, string][]} when, kind, unit, words */
  let marks = [];
  /** @type {number | null} where a hand holds the time, until the cell is there */
  let held = null;
  let asking = false;
  let dragging = false;
  let due = true;
  let shown = "";
  let news = 0; // counts marks that came

  const begin = () => get("begin") || 0;
  const end = () => Math.max(get("end") || 0, get("now") || 0, begin() + 1e6);
  const width = () => Math.max(1, canvas.clientWidth - 2 * LEFT);
  /** @param {number} t */
  const x = (t) => LEFT + ((t - begin()) / (end() - begin())) * width();
  /** @param {number} px */
  const t = (px) => Math.round(begin() + Math.max(0, Math.min(1, (px - LEFT) / width())) * (end() - begin()));

  function draw() {
    due = false;
    const wide = canvas.clientWidth;
    const high = canvas.clientHeight;
    const now = held === null ? get("now") || 0 : held;
    const span = end() - begin();
    const every = pitch(span, Math.max(2, wide / 92));
    const first = Math.ceil(begin() / every) * every;
    const look = [now, end(), first, first + every].map((at) => Math.round(x(at) * 2)).concat(every, first, wide, high, news).join();
    if (look === shown) return; // nothing has moved by half a pixel
    shown = look;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(high * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, high);
    const rail = 11;
    pen.fillStyle = "#0b0f10";
    pen.beginPath();
    pen.roundRect(0, 0, wide, 22, 3);
    pen.fill();
    pen.fillStyle = "#35565a";
    pen.fillRect(LEFT, rail - 3, Math.max(0, x(now) - LEFT), 6);
    pen.fillStyle = "#232b2e"; // what lies behind, while one looks into the past
    pen.fillRect(x(now), rail - 3, Math.max(0, x(end()) - x(now)), 6);

    const digits = Math.max(0, Math.min(9, 9 - Math.floor(Math.log10(every))));
    pen.font = '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace';
    pen.textBaseline = "top";
    pen.fillStyle = "#a9b0b3";
    pen.strokeStyle = "#4b565a";
    pen.lineWidth = 1;
    for (let at = first; at <= end(); at += every) {
      const px = Math.round(x(at)) + 0.5;
      pen.beginPath();
      pen.moveTo(px, 22);
      pen.lineTo(px, 26);
      pen.stroke();
      const text = (at / 1e9).toFixed(digits);
      const half = pen.measureText(text).width / 2;
      if (px + half < wide && px - half > 0) pen.fillText(text, px - half, 27);
      else if (px - half <= 0) pen.fillText(text, 2, 27);
    }
    /** @type {Record<string, number>} */
    const last = {};
    for (const [at, kind] of marks) {
      const px = Math.round(x(at));
      if (px < 0 || px > wide || last[kind] === px) continue;
      last[kind] = px;
      pen.fillStyle = COLOURS[kind] || "#c3c9cc";
      if (kind === "error" || kind === "breakpoint" || kind === "caution") {
        pen.beginPath();
        pen.moveTo(px, 5);
        pen.lineTo(px + 4, 11);
        pen.lineTo(px, 17);
        pen.lineTo(px - 4, 11);
        pen.fill();
      } else pen.fillRect(px - 1, 4, 2, 14);
    }
    const px = x(now);
    pen.fillStyle = "#eceae4";
    pen.fillRect(px - 1, 0, 2, 22);
    pen.beginPath();
    pen.roundRect(px - 5, 3, 10, 16, 3);
    pen.fill();
    pen.fillStyle = "#23282b";
    pen.fillRect(px - 0.5, 7, 1, 8);
    box.setAttribute("aria-valuemin", (begin() / 1e9).toFixed(3));
    box.setAttribute("aria-valuemax", (end() / 1e9).toFixed(3));
    box.setAttribute("aria-valuenow", (now / 1e9).toFixed(6));
    box.setAttribute("aria-valuetext", `${(now / 1e9).toFixed(6)} s`);
  }

  /** Take the cell to `held`; while it is on its way the newest wish is kept, no queue of them. */
  async function follow() {
    if (asking) return;
    asking = true;
    try {
      while (held !== null) {
        const aim = held;
        await call("rewind", aim);
        if (held === aim && !dragging) held = null;
        else if (held === aim) break;
      }
    } catch (error) {
      held = null;
      failed(error);
    }
    asking = false;
    if (dragging && held !== null && held !== get("now")) return;
    plan();
  }

  function plan() {
    if (!due) {
      due = true;
      requestAnimationFrame(draw);
    }
  }

  /** @param {number} px */
  function near(px) {
    let best = null;
    let least = 7; // px
    for (const mark of marks) {
      const far = Math.abs(x(mark[0]) - px);
      if (far < least) [best, least] = [mark, far];
    }
    return best;
  }

  /** @param {PointerEvent} event */
  function point(event) {
    const px = event.clientX - box.getBoundingClientRect().left;
    const mark = near(px);
    const at = mark && !dragging ? mark[0] : t(px);
    tag.textContent = mark ? `${seconds(mark[0])} s  ${mark[2] ? `${mark[2]}: ` : ""}${mark[3]}` : `${seconds(at)} s`;
    tag.classList.add("shown");
    const half = tag.offsetWidth / 2;
    tag.style.left = `${Math.max(half, Math.min(px, box.clientWidth - half))}px`;
    return mark ? mark[0] : at;
  }

  box.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    box.focus({ preventScroll: true });
    box.setPointerCapture(event.pointerId);
    dragging = true;
    held = point(event);
    follow();
    plan();
  });
  box.addEventListener("pointermove", (event) => {
    const at = point(event);
    if (!dragging) return;
    held = at;
    follow();
    plan();
  });
  const drop = () => {
    if (!dragging) return;
    dragging = false;
    if (held !== null) follow();
    tag.classList.remove("shown");
  };
  box.addEventListener("pointerup", drop);
  box.addEventListener("pointercancel", drop);
  box.addEventListener("pointerleave", () => dragging || tag.classList.remove("shown"));
  box.addEventListener("keydown", (event) => {
    const coarse = (end() - begin()) / 100;
    /** @type {Record<string, number>} */
    const keys = { ArrowLeft: -coarse, ArrowRight: coarse, PageUp: -10 * coarse, PageDown: 10 * coarse };
    const far = keys[event.key];
    let aim = null;
    if (far) aim = (held ?? get("now") ?? 0) + far;
    else if (event.key === "Home") aim = begin();
    else if (event.key === "End") aim = end();
    if (aim === null) return;
    event.preventDefault();
    held = Math.round(Math.max(begin(), Math.min(end(), aim)));
    follow();
    plan();
  });

  const ends = [
    on("marks", (key, value) => {
      marks = value || [];
      news += 1;
      plan();
    }),
    frame(plan),
  ];
  const resized = new ResizeObserver(plan);
  resized.observe(box);
  draw();
  return () => {
    for (const end of ends) end();
    resized.disconnect();
  };
});

part("waiting", (chip) => on("queue", (key, value) => {
  const count = (value || []).length;
  chip.hidden = !count;
  chip.textContent = count === 1 ? "1 command waits" : `${count} commands wait`;
}));

part("branches", (chip) => {
  chip.addEventListener("click", () => {
    const futures = /** @type {HTMLDialogElement} */ (document.querySelector("dialog.futures"));
    futures.showModal();
  });
  return on("branches", (key, value) => {
    const count = (value || []).length;
    chip.hidden = !count;
    chip.textContent = count === 1 ? "1 other future" : `${count} other futures`;
  });
});

part("futures", (dialog) => {
  dialog.querySelector("[data-close]").addEventListener("click", () => dialog.close());
  return on("branches", (key, value) => {
    dialog.querySelector("ul").replaceChildren(...(value || []).map((/** @type {[number, number, number]} */ [number, at, end]) => {
      const item = document.createElement("li");
      const what = document.createElement("span");
      what.textContent = `left at ${seconds(at)} s, had come to ${seconds(end)} s`;
      const told = document.createElement("pre");
      const compare = document.createElement("button");
      const take = document.createElement("button");
      compare.className = "key small";
      compare.textContent = "Compare";
      take.className = "key small primary";
      take.textContent = "Take it again";
      compare.addEventListener("click", async () => {
        const found = await call("compare_branch", number).catch((error) => [wordsOf(error)]);
        told.textContent = found.join("\n");
      });
      take.addEventListener("click", () => {
        dialog.close();
        call("take_branch", number).catch(failed);
      });
      item.append(what, compare, take, told);
      return item;
    }));
  });
});

part("go", (button) => button.addEventListener("click", turnTime));
