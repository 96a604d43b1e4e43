// One parameter as a slider, box, switch or menu. The service decides what is allowed; its reason is shown here.

import { el, setText, show } from "./dom.js";

const PACE = 120; // ms between two changes while a slider is dragged

export class Widget {
  // `change({name: value})` is a promise that rejects with the reason; `unset(name)` takes back what was set.
  constructor(description, change, unset) {
    this.description = description;
    this.change = change;
    this.busy = false;
    this.next = undefined;
    this.held = false;
    const d = description;
    this.origin = el("span", { class: "origin" });
    this.reason = el("p", { class: "reason bad", hidden: true });
    this.back = el("button", { class: "bare", hidden: true, title: "Return to the value of the fleet file or the default", onclick: () => unset(d.name, this.back) }, "↺");
    const control = this.make(d);
    this.element = el("div", { class: `parameter ${d.live ? "" : "fixed"}`, title: d.text },
      el("div", { class: "line" }, el("span", { class: "name" }, d.name), this.origin, this.back),
      control, el("small", { class: "quiet text" }, [d.text, bounds(d), d.live ? "" : "fixed while the service runs: set it in the fleet file"].filter(Boolean).join(" · ")), this.reason);
    this.element.dataset.name = d.name;
  }

  make(d) {
    const common = { disabled: !d.live, "aria-label": d.name };
    const unit = d.unit ? el("span", { class: "unit quiet" }, d.unit) : null;
    if (d.choices.length) {
      const box = this.box = el("select", { ...common, onchange: () => this.send(box.value) },
        ...(d.optional ? [el("option", { value: "" }, "none")] : []), ...d.choices.map((each) => el("option", { value: each }, each)));
      this.read = () => (d.optional && box.value === "" ? null : box.value);
      this.write = (value) => { box.value = value ?? ""; };
      return el("div", { class: "line" }, box, unit);
    }
    if (d.type === "bool") {
      const box = this.box = el("input", { ...common, type: "checkbox", class: "switch", onchange: () => this.send(box.checked) });
      this.write = (value) => { box.checked = value === true; };
      return el("div", { class: "line" }, box, unit);
    }
    if (d.type === "float" || d.type === "int") return this.number(d, common, unit);
    const box = this.box = el("input", { ...common, type: "text", class: "long", spellcheck: false, onchange: () => this.typed() });
    this.write = (value) => { box.value = d.type === "str" ? value ?? "" : JSON.stringify(value); };
    return el("div", { class: "line" }, box, unit);
  }

  number(d, common, unit) {
    const step = d.type === "int" ? 1 : "any";
    const box = this.box = el("input", { ...common, type: "number", step, placeholder: d.optional ? "none" : "", onchange: () => this.typed() });
    const bounded = d.low !== null && d.high !== null;
    const scale = bounded ? scaleOf(d) : null;
    const slider = bounded ? el("input", { ...common, type: "range", min: scale.low, max: scale.high, step: scale.step,
      oninput: () => { box.value = rounded(scale.value(slider.value)); this.held = true; this.soon(scale.value(slider.value)); },
      onchange: () => { this.held = false; this.send(scale.value(slider.value)); },
      onpointerup: () => { this.held = false; } }) : null;
    this.write = (value) => {
      box.value = value === null ? "" : rounded(value);
      if (slider && value !== null) slider.value = scale.place(value);
    };
    return el("div", { class: "line" }, slider, box, unit);
  }

  typed() {
    const { type, optional } = this.description, text = this.box.value.trim();
    if (type === "str") { this.send(this.box.value); return; }
    if (text === "" && optional) { this.send(null); return; }
    try { this.send(JSON.parse(text)); } catch { this.refuse(`${text || "an empty value"} is not a valid ${type}; lists are written as [1, 2]`); }
  }

  soon(value) {
    this.next = value;
    if (!this.pacing) this.pacing = setTimeout(() => { this.pacing = 0; if (this.next !== undefined) this.send(this.next); }, PACE);
  }

  // One request at a time; of what is wanted meanwhile, the last.
  async send(value) {
    clearTimeout(this.pacing);
    this.pacing = 0;
    if (this.busy) { this.next = value; return; }
    this.busy = true;
    this.next = undefined;
    this.element.classList.add("busy");
    try {
      await this.change({ [this.description.name]: value });
      this.refuse("");
    } catch (error) {
      this.next = undefined;
      this.refuse(error.message);
    }
    this.busy = false;
    this.element.classList.remove("busy");
    if (this.next !== undefined) this.send(this.next);
    else if (!this.held && this.value !== undefined) this.write(this.value);
  }

  refuse(reason) {
    setText(this.reason, reason);
    show(this.reason, Boolean(reason));
    if (reason && this.value !== undefined) this.write(this.value);
  }

  update(value, origin) {
    const changed = JSON.stringify(value) !== JSON.stringify(this.value);
    this.value = value;
    if (changed) this.refuse(""); // it was of a value that nobody wants any more
    setText(this.origin, origin === "default" ? "" : origin);
    show(this.back, origin === "run" || origin === "saved");
    if (!this.held && !this.busy && document.activeElement !== this.box) this.write(value);
    else if (changed && !this.held && !this.busy) this.write(value);
  }
}

// How a slider's way stands for values: evenly, or finer near the low end where the range is wide for what is usual.
function scaleOf({ type, low, high, default: usual }) {
  if (type === "float" && low >= 0 && high > 20 * Math.max(usual || 0, 1)) {
    return { low: 0, high: 1, step: 0.002,
      value: (place) => Math.min(high, Math.max(low, Number((low + (high - low) * Number(place) ** 3).toPrecision(3)))),
      place: (value) => Math.cbrt((value - low) / (high - low)) };
  }
  return { low, high, step: type === "int" ? 1 : fine(high - low), value: Number, place: (value) => value };
}

const fine = (span) => 10 ** Math.floor(Math.log10(span / 100));
const rounded = (value) => (Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(8))));

function bounds({ low, high, above, below }) {
  const left = low === null ? "" : `${above ? "above " : ""}${low}`, right = high === null ? "" : `${below ? "below " : ""}${high}`;
  if (left && right) return `${left} to ${right}`;
  return left ? `at least ${left}` : right ? `at most ${right}` : "";
}
