// The log of all nodes: by level, node and words; it follows the newest line until somebody scrolls up.

import { el, setText } from "./dom.js";
import { clockText } from "./header.js";

const MOST = 1500;
const LEVELS = [[1, "debug"], [2, "info"], [4, "warn"], [8, "error"]];

export function startLog(link) {
  let lines = [], level = 2, visible = false;
  const filter = el("input", { type: "search", placeholder: "Filter by text or node", "aria-label": "Filter the log", oninput: redraw });
  const levels = el("select", { "aria-label": "Minimum level", onchange: () => { level = Number(levels.value); redraw(); } },
    ...LEVELS.map(([value, name]) => el("option", { value, selected: value === 2 }, name)));
  const count = el("span", { class: "quiet num" });
  const body = el("div", { class: "lines", role: "log" });
  const element = el("div", { class: "view log" },
    el("div", { class: "toolbar" }, filter, levels, el("button", { onclick: () => { lines = []; redraw(); } }, "Clear"), el("span", { class: "fill" }), count), body);

  const fits = (line) => line[2] >= level && (!filter.value || `${line[3]} ${line[4]}`.toLowerCase().includes(filter.value.trim().toLowerCase()));

  function drawn([, t, weight, name, text, place]) {
    const kind = weight >= 8 ? "error" : weight >= 4 ? "warn" : weight >= 2 ? "info" : "debug";
    return el("div", { class: `line ${kind}`, title: place }, el("span", { class: "num quiet" }, clockText(t)), el("span", { class: "level" }, kind),
      el("span", { class: "who" }, name), el("span", { class: "what" }, text));
  }

  function redraw() {
    body.replaceChildren(...lines.filter(fits).map(drawn));
    body.scrollTop = body.scrollHeight;
    counted();
  }

  const counted = () => setText(count, `${body.children.length} of ${lines.length}`);

  link.on("log", ({ lines: added, first }) => {
    if (first) lines = [];
    lines.push(...added);
    if (lines.length > MOST) lines = lines.slice(-MOST);
    if (first) { redraw(); return; }
    const follows = body.scrollHeight - body.scrollTop - body.clientHeight < 40;
    body.append(...added.filter(fits).map(drawn));
    while (body.children.length > MOST) body.firstElementChild.remove();
    if (follows && visible) body.scrollTop = body.scrollHeight;
    counted();
  });
  link.subscribe("log", { channels: ["log"] });
  return { element, show() { visible = true; body.scrollTop = body.scrollHeight; }, hide() { visible = false; } };
}
