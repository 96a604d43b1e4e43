// The topics and their fields, live, to choose from for a plot.

import { el, setText } from "./dom.js";
import { ownFirst, store } from "./store.js";

const MOST_OPEN = 3;
const DULL = /\/parameter_(descriptions|updates)$/; // shown when they are looked for

export function startChooser(link, plot) {
  const filter = el("input", { type: "search", placeholder: "Filter topics", "aria-label": "Filter topics", oninput: () => list() });
  const topics = el("div", { class: "topics" });
  const element = el("aside", { class: "pane fields" }, filter, topics);
  const rows = new Map(); // topic -> {row, body, fields: Map(path -> {row, value})}
  let open = [], visible = false;

  function list() {
    const wanted = filter.value.trim().toLowerCase();
    const names = ownFirst(store.topics, (each) => each.name).filter((each) => each.pubs.length && each.name.toLowerCase().includes(wanted) && (wanted || !DULL.test(each.name))).map((each) => each.name);
    for (const [name, { row }] of rows) if (!names.includes(name)) { row.remove(); rows.delete(name); }
    names.forEach((name, index) => {
      if (!rows.has(name)) rows.set(name, make(name));
      const { row } = rows.get(name);
      if (topics.children[index] !== row) topics.insertBefore(row, topics.children[index] ?? null);
    });
    open = open.filter((name) => rows.has(name));
    subscribe();
  }

  function make(name) {
    const topic = store.topics.find((each) => each.name === name);
    const body = el("div", { class: "leaves", hidden: true });
    const at = name.lastIndexOf("/") + 1;
    const head = el("button", { class: "topic", title: topic.types.join(", "), onclick: () => toggle(name), "aria-expanded": "false" },
      el("span", {}, el("span", { class: "quiet" }, name.slice(0, at)), name.slice(at)),
      el("small", { class: "quiet" }, topic.types[0]?.split("/").pop() ?? ""));
    return { row: el("div", {}, head, body), head, body, fields: new Map() };
  }

  function toggle(name) {
    if (open.includes(name)) open = open.filter((each) => each !== name);
    else open = [...open, name].slice(-MOST_OPEN);
    for (const [each, { body, head, fields }] of rows) {
      const shown = open.includes(each);
      body.hidden = !shown;
      head.setAttribute("aria-expanded", String(shown));
      if (!shown) { body.replaceChildren(); fields.clear(); }
      else if (!fields.size) body.replaceChildren(el("p", { class: "hint" }, "waiting for a message"));
    }
    subscribe();
  }

  function subscribe() {
    link.subscribe("chooser", visible ? { channels: ["graph"], fields: open } : { channels: ["graph"] });
  }

  function fill({ topic, fields }) {
    const known = rows.get(topic);
    if (!known || !fields || !open.includes(topic)) return;
    const same = known.fields.size === fields.length && fields.every(([path]) => known.fields.has(path));
    if (!same) {
      known.fields.clear();
      known.body.replaceChildren(...fields.map(([path, value]) => leaf(known, topic, path, value)));
    }
    for (const [path, value] of fields) setText(known.fields.get(path).value, text(value));
  }

  function leaf(known, topic, path, value) {
    const shown = el("span", { class: "num value" }, text(value));
    const numeric = typeof value === "number" || typeof value === "boolean";
    const row = numeric
      ? el("button", { class: "leaf", "aria-pressed": String(plot.has(topic, path)), title: "Add this field to the plot, or remove it", onclick: () => plot.toggle(topic, path) }, el("span", {}, path), shown)
      : el("div", { class: "leaf dull" }, el("span", {}, path), shown);
    known.fields.set(path, { row, value: shown });
    return row;
  }

  const text = (value) => (typeof value === "number" ? String(Number(value.toPrecision(6))) : value === null ? "none" : String(value).slice(0, 40));

  link.on("graph", list);
  link.on("fields", fill);
  subscribe();
  return {
    element,
    show() { visible = true; subscribe(); },
    hide() { visible = false; subscribe(); },
    refresh() {
      for (const [topic, { fields }] of rows) {
        for (const [path, { row }] of fields) if (row.tagName === "BUTTON") row.setAttribute("aria-pressed", String(plot.has(topic, path)));
      }
    },
  };
}
