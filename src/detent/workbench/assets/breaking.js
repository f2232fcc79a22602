// The panel "Break it" of the page Cell: a fault is chosen and set; those that stand are mended with a click.

const { part, on, action, call, failed } = window.detent;

part("breaking", (box) => {
  const kinds = JSON.parse(box.dataset.kinds);
  const helps = JSON.parse(box.dataset.helps);
  const form = box.querySelector("form");
  const more = box.querySelector(".more");
  const list = box.querySelector(".standing");
  /** @type {Record<string, string>} */
  const FIRST = { rate: "0.1", by: "50 ms", level: "0" };

  function choose() {
    const [, , takes, places] = kinds.find((/** @type {any[]} */ [name]) => name === form.elements.kind.value);
    const before = form.elements.where.value;
    form.elements.where.replaceChildren(...places.map((/** @type {string} */ place) => new Option(place, place)));
    if (places.includes(before)) form.elements.where.value = before;
    more.replaceChildren(...takes.map((/** @type {string} */ name) => {
      const label = document.createElement("label");
      const field = document.createElement("input");
      label.className = "quiet";
      label.dataset.help = helps[name];
      field.className = "field num";
      field.name = name;
      field.setAttribute("aria-label", name);
      field.value = FIRST[name] || "";
      label.append(`${name} `, field);
      return label;
    }));
    form.elements.for.value = form.elements.kind.value === "dip" ? "200 ms" : "";
  }

  form.elements.kind.addEventListener("change", choose);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    /** @type {Record<string, string>} */
    const given = {};
    for (const field of form.querySelectorAll("input")) if (field.value.trim()) given[field.name] = field.value.trim();
    try {
      await call("breaks", form.elements.where.value, form.elements.kind.value, given);
    } catch (error) {
      failed(error);
    }
  });
  choose();
  let shown = "";
  return on("faults", (key, value) => {
    const text = JSON.stringify(value);
    if (text === shown) return;
    shown = text;
    list.replaceChildren(...(value || []).map((/** @type {[number, string]} */ [number, words]) => {
      const item = document.createElement("li");
      const what = document.createElement("span");
      const mend = document.createElement("button");
      what.className = "grow";
      what.textContent = words;
      mend.className = "key small";
      mend.textContent = "Mend";
      mend.setAttribute("aria-label", `Mend ${words}`);
      mend.addEventListener("click", () => action("mend", number));
      item.append(what, mend);
      return item;
    }));
  });
});

part("broken", (chip) => on("faults", (key, value) => {
  const count = (value || []).length;
  chip.hidden = !count;
  chip.textContent = count === 1 ? "1 fault: mend" : `${count} faults: mend`;
  chip.dataset.help = `${(value || []).map((/** @type {[number, string]} */ [, words]) => words).join("\n")}\nClick: mend all of it`;
  chip.onclick = () => action("mend", null);
}));
