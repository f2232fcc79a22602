// Manual control of the axes of the page Cell: what is clicked is said to the unit by its host, in the unit's own commands.

import { remeasured, wholeSteps } from "./forms.js";
import { holding } from "./holding.js";

const { part, on, get, call, asking, toast, failed, remembered, remember } = window.detent;

part("manual", (box) => {
  const facts = JSON.parse(box.dataset.facts);
  const name = `${facts.name} (cell)`; // as the page Unit calls it, too
  /** @param {string} one */
  const role = (one) => box.querySelector(`[data-role="${one}"]`);
  const measure = role("measure");
  if (measure) measure.value = remembered(`measure.${facts.name}`) || "mm";
  /** Steps in one unit of what is written. */
  const scale = () => (measure && measure.value ? 1 / facts.lead : 1);
  let scaled = 1; // the fields come in steps

  /** The fields say the same lengths and rates by another measure: nothing goes farther because it is chosen. */
  function measured() {
    for (const one of ["by", "rate"]) role(one).value = remeasured(role(one).value, scaled, scale());
    scaled = scale();
  }
  measured();

  /** @param {Part} field */
  function number(field) {
    const value = Number(field.value);
    if (field.value !== "" && Number.isFinite(value)) return value;
    toast("Write a number first.", "error");
    field.focus();
    return null;
  }

  /** The unit, with a host that speaks to it: connected to at the first touch. */
  async function there(ask = asking()) {
    if (get("held") && !get("real")) throw new Error("The cell stands, and its unit cannot answer: let time go on first.");
    return ask("unit_connect", facts.model, facts.address, facts.options, name);
  }

  /** @param {string} text */
  const say = (text) => (role("sent").textContent = text);
  /** @param {string[]} lines */
  const told = (lines) => say(lines.length ? `sent ${lines.join(", ")}` : "nothing had to be sent");

  /** @param {"jog" | "go" | "zero" | "home"} what */
  async function move(what, value = 0) {
    const ask = asking(); // while it is connected to, somebody may press STOP
    try {
      const steps = wholeSteps(value);
      await there(ask);
      told(await ask("unit_move", name, what, steps));
    } catch (error) {
      failed(error);
    }
  }

  /**
   * @param {string} who
   * @param {Promise<string>} stopping
   */
  async function stopped(who, stopping) {
    document.dispatchEvent(new CustomEvent("detent-stopping", { detail: { who, stopping } }));
    hold.letGo(false);
    const told = await stopping.catch(() => ""); // it stands above the page
    if (told) say(told);
  }

  for (const button of box.querySelectorAll("[data-jog]")) button.addEventListener("click", () => {
    const by = number(role("by"));
    if (by !== null) move("jog", by * scale() * Number(button.dataset.jog));
  });
  role("go").addEventListener("click", () => {
    const to = number(role("by"));
    if (to !== null) move("go", to * scale());
  });
  role("zero").addEventListener("click", () => move("zero"));
  for (const button of box.querySelectorAll("[data-home]")) button.addEventListener("click", () => move("home", Number(button.dataset.home)));
  // a stop does not wait for the connection: what does wait for that is ended by it
  role("stop").addEventListener("click", () => stopped(name, Promise.all([there(), call("unit_stop", name)]).then(([, told]) => told)));
  const hold = holding([...box.querySelectorAll("[data-hold]")], {
    name: () => name,
    rate: (/** @type {Part} */ button) => {
      if (!get(`r.${name}`)) {
        there().then(() => toast("Connected: hold the key once more."), failed);
        return null;
      }
      const by = number(role("rate"));
      return by === null ? null : by * scale() * Number(button.dataset.hold);
    },
    sent: told,
    stopped,
  });
  measure?.addEventListener("change", () => {
    measured();
    remember(`measure.${facts.name}`, measure.value);
  });

  /** @param {any} facts null where nobody is connected to it any more */
  function show(facts) {
    if (!facts) {
      for (const one of box.querySelectorAll("[data-jog], [data-hold], [data-home], [data-role=go], [data-role=zero]")) one.disabled = false;
      return;
    }
    const busy = Boolean(facts.job || facts.lost || facts.stopping);
    for (const one of box.querySelectorAll("[data-jog], [data-role=go], [data-role=zero]")) one.disabled = busy;
    for (const one of box.querySelectorAll("[data-home]")) {
      one.disabled = busy || facts.can.home !== "";
      one.dataset.help = facts.can.home || `Search for home, ${one.dataset.home < 0 ? "minus" : "plus"}. ${facts.can.before_home}`;
    }
    for (const one of box.querySelectorAll("[data-hold]")) {
      one.disabled = facts.can.hold !== "" || (busy && !facts.held);
      one.dataset.help = facts.can.hold || `Runs as long as the key is held. ${facts.can.before_hold}`;
    }
    const why = facts.lost || facts.trouble;
    if (why) say(why);
  }
  const ends = on(`r.${name}`, (key, value) => key === `r.${name}` && show(value));
  return () => {
    hold.end();
    ends();
  };
});

part("compact", (button) => {
  const cell = /** @type {Part} */ (document.querySelector(".cell"));
  const chosen = remembered("compact");
  const many = Number(button.dataset.units) >= Number(button.dataset.many);
  /** @param {boolean} on */
  const set = (on) => {
    cell.classList.toggle("compact", on);
    button.setAttribute("aria-pressed", on ? "true" : "false");
  };
  set(chosen === null ? many : chosen === "yes");
  button.addEventListener("click", () => {
    const on = !cell.classList.contains("compact");
    remember("compact", on ? "yes" : "no");
    set(on);
  });
});
