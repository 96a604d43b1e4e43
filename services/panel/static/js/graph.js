// The view of the graph: who publishes and reads what, how often, what was lost, and how old the last word is.

import { el, setText, storage, svg, updateChildren } from "./dom.js";
import { layout, NODE, ROW } from "./graph_layout.js";
import { details, loss, rate } from "./graph_details.js";
import { store } from "./store.js";

const QUIET = /^\/(rosout|health|clock)$|\/parameter_(descriptions|updates)$/;

const MOST = 150; // topics that are drawn; the filter finds the others

export function startGraph(link) {
  const filter = el("input", { type: "search", placeholder: "Filter topics and nodes", "aria-label": "Filter the graph", oninput: () => draw() });
  const all = el("input", { type: "checkbox", checked: storage.get("housekeeping", false), onchange: () => { storage.set("housekeeping", all.checked); draw(); } });
  const drawing = el("div", { class: "drawing scroll" }), table = el("tbody");
  const aside = el("aside", { class: "pane details" });
  const count = el("span", { class: "quiet num" });
  const element = el("div", { class: "view graph" },
    el("div", { class: "toolbar" }, filter, el("label", { class: "line", title: "Log, heartbeats, clock and parameters" }, all, "housekeeping"), el("span", { class: "fill" }), count),
    drawing,
    el("div", { class: "topic-table scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["Topic", "Rate", "Lost", "Age"].map((each) => el("th", {}, each)))), table)), aside);
  let visible = false, chosen = null, marks = [];

  function shownTopics() {
    const wanted = filter.value.trim().toLowerCase();
    return store.topics.filter((each) => (all.checked || !QUIET.test(each.name))
      && (!wanted || [each.name, ...each.pubs, ...each.subs].some((name) => name.toLowerCase().includes(wanted))));
  }

  function draw() {
    if (!visible) return;
    const found = shownTopics(), topics = found.slice(0, MOST);
    const more = found.length > MOST ? `, the first ${MOST} drawn: use the filter to find others` : "";
    setText(count, `${store.nodes.length} nodes, ${found.length} of ${store.topics.length} topics${more}`);
    const { left, middle, right, height } = layout(topics);
    const width = Math.max(640, drawing.clientWidth - 20), side = width < 760 ? 140 : 170, wide = Math.min(380, width - 2 * side - 110);
    const from = (width - wide) / 2;
    const edges = svg("g", { class: "edges" }), boxes = svg("g");
    marks = [];
    for (const topic of topics) {
      const y = middle.get(topic.name);
      for (const node of topic.pubs) edges.append(edge(side, left.get(node), from, y, node, topic.name));
      for (const node of topic.subs) edges.append(edge(from + wide, y, width - side, right.get(node), node, topic.name));
    }
    for (const [name, y] of left) boxes.append(nodeBox(name, 0, y, side));
    for (const [name, y] of right) boxes.append(nodeBox(name, width - side, y, side));
    for (const topic of topics) boxes.append(topicBox(topic, from, middle.get(topic.name), wide));
    const picture = svg("svg", { width, height: Math.max(60, height), viewBox: `0 0 ${width} ${Math.max(60, height)}`, onclick: () => choose(null) }, edges, boxes);
    const held = drawing.contains(document.activeElement) ? document.activeElement.dataset : null;
    drawing.replaceChildren(picture);
    if (held) [...drawing.querySelectorAll("[tabindex]")].find(({ dataset }) => dataset.node === held.node && dataset.topic === held.topic)?.focus({ preventScroll: true });
    table.replaceChildren(...topics.map((topic) => {
      const cells = [el("td", { class: "num" }), el("td", { class: "num" }), el("td", { class: "num quiet" })];
      const row = el("tr", { onclick: () => choose({ topic: topic.name }) }, el("td", {}, el("button", { class: "link" }, topic.name)), ...cells);
      marks.push(() => {
        const known = store.rates.topics[topic.name];
        setText(cells[0], rate(known, topic));
        setText(cells[1], String(loss(topic.name) || ""));
        cells[1].classList.toggle("bad", loss(topic.name) > 0);
        setText(cells[2], known?.age === null || known?.age === undefined ? "" : `${known.age.toFixed(0)} s`);
      });
      return row;
    }));
    refresh();
  }

  function edge(x0, y0, x1, y1, node, topic) {
    const bend = (x1 - x0) / 2;
    const path = svg("path", { d: `M${x0} ${y0}C${x0 + bend} ${y0} ${x1 - bend} ${y1} ${x1} ${y1}`, "data-node": node, "data-topic": topic });
    marks.push(() => {
      const lost = store.rates.nodes[node]?.inputs[topic]?.[1] ?? 0;
      path.classList.toggle("bad", x0 > 200 && lost > 0);
    });
    return path;
  }

  // What a press of a box chooses, by mouse and by key.
  const chooses = (what, label) => ({ tabindex: 0, role: "button", "aria-label": label,
    onclick: (event) => { event.stopPropagation(); choose(what); },
    onkeydown: (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(what); } } });

  function nodeBox(name, x, y, width) {
    const box = svg("g", { class: "node", "data-node": name, ...chooses({ node: name }, `node ${name}`) },
      svg("rect", { x: x + 0.5, y: y - NODE / 2 + 2.5, width: width - 1, height: NODE - 5, rx: 5 }),
      svg("circle", { cx: x + 11, cy: y, r: 3.5 }), svg("text", { x: x + 20, y: y + 4 }, clipped(name, Math.floor((width - 28) / 6.4))), svg("title", {}, name));
    marks.push(() => {
      const health = store.rates.nodes[name];
      box.classList.toggle("bad", Boolean(health && health.age > 3));
      box.classList.toggle("good", Boolean(health && health.age <= 3));
    });
    return box;
  }

  function topicBox(topic, x, y, width) {
    const number = svg("text", { x: x + width - 8, y: y + 4, "text-anchor": "end", class: "num" });
    const box = svg("g", { class: "topic", "data-topic": topic.name, ...chooses({ topic: topic.name }, `topic ${topic.name}`) },
      svg("rect", { x: x + 0.5, y: y - ROW / 2 + 1.5, width: width - 1, height: ROW - 3, rx: 3 }),
      svg("text", { x: x + 8, y: y + 4 }, clipped(topic.name, Math.floor((width - 90) / 7))), number, svg("title", {}, topic.name));
    marks.push(() => {
      const lost = loss(topic.name), text = rate(store.rates.topics[topic.name], topic);
      setText(number, lost ? `${lost} lost · ${text}` : text);
      box.classList.toggle("bad", lost > 0);
      box.classList.toggle("idle", topic.pubs.length === 0);
    });
    return box;
  }

  function refresh() {
    for (const mark of marks) mark();
    const near = new Set();
    if (chosen) {
      for (const topic of store.topics) {
        if (chosen.topic === topic.name || topic.pubs.includes(chosen.node) || topic.subs.includes(chosen.node)) near.add(`t${topic.name}`);
        if (chosen.topic === topic.name) [...topic.pubs, ...topic.subs].forEach((node) => near.add(`n${node}`));
      }
      if (chosen.node) near.add(`n${chosen.node}`);
    }
    for (const each of drawing.querySelectorAll("[data-node], [data-topic]")) {
      const { node, topic } = each.dataset;
      const lit = !chosen || (node && topic ? node === chosen.node || topic === chosen.topic : near.has(node ? `n${node}` : `t${topic}`));
      each.classList.toggle("dim", !lit);
      each.classList.toggle("lit", Boolean(chosen) && lit);
    }
    element.classList.toggle("with-details", Boolean(chosen));
    updateChildren(aside, chosen ? details(chosen, choose) : []);
  }

  function choose(what) {
    chosen = what;
    refresh();
  }

  const clipped = (text, most) => (text.length > most ? `…${text.slice(1 - most)}` : text);

  link.on("graph", () => {
    if (chosen?.node && !store.nodes.some((each) => each.name === chosen.node)) chosen = null;
    draw();
  });
  link.on("rates", () => { if (visible) refresh(); });
  new ResizeObserver(() => draw()).observe(drawing);
  link.subscribe("graph", { channels: ["graph"] });
  return {
    element,
    show() { visible = true; link.subscribe("graph", { channels: ["graph", "rates"] }); draw(); },
    hide() { visible = false; link.subscribe("graph", { channels: ["graph"] }); },
  };
}
