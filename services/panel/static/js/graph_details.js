// What is known of one node or topic of the graph, as lines of text.

import { el } from "./dom.js";
import { store } from "./store.js";

// Samples per second of simulation time; while it stands still, of wall time.
export function rate(known, topic) {
  if (!known || !topic.pubs.length) return topic.pubs.length ? "" : "no publisher";
  const hz = known.hz || known.wall;
  if (!hz) return known.sent ? "quiet" : "idle";
  return `${hz.toFixed(hz < 10 ? 1 : 0)} Hz`;
}

// Samples of a topic that its readers have lost, all together.
export function loss(topic) {
  return Object.values(store.rates.nodes).reduce((sum, node) => sum + (node.inputs[topic]?.[1] ?? 0), 0);
}

export function details(chosen, choose) {
  return chosen.topic ? ofTopic(chosen.topic, choose) : ofNode(chosen.node, choose);
}

const fact = (name, value, kind = "") => el("div", { class: "fact" }, el("span", { class: "quiet" }, name), el("span", { class: kind }, value));
const close = (choose) => el("button", { class: "bare close", title: "Close", onclick: () => choose(null) }, "×");

function ofTopic(name, choose) {
  const topic = store.topics.find((each) => each.name === name), known = store.rates.topics[name];
  if (!topic) return [close(choose), el("h2", {}, name), el("p", { class: "hint" }, "This topic no longer exists.")];
  const readers = topic.subs.map((node) => {
    const [received, lost, refused, foreign, reason, repeated, resynced] = store.rates.nodes[node]?.inputs[name] ?? [];
    const counts = received === undefined ? "" : [`${received} received`, lost && `${lost} lost`, refused && `${refused} refused`, repeated && `${repeated} repeated`, resynced && `${resynced} renumbered`, foreign && `${foreign} foreign`].filter(Boolean).join(", ");
    return el("li", {}, link(node, { node }, choose), el("small", { class: lost || refused ? "bad" : "quiet" }, [counts, reason].filter(Boolean).join(": ")));
  });
  return [close(choose), el("h2", {}, name),
    fact("type", topic.types.join(", "), topic.types.length > 1 ? "bad" : ""), fact("quality", topic.quality),
    fact("rate", `${known ? known.hz.toFixed(1) : "–"} Hz of simulation time${topic.promised ? `, ${topic.promised} promised` : ""}`),
    fact("wall-clock rate", `${known ? known.wall.toFixed(1) : "–"} Hz`), fact("sent", String(known?.sent ?? "–")),
    fact("last", known?.age === null || known?.age === undefined ? "–" : known.age < 1.5 ? "within the last second" : `${known.age.toFixed(0)} s ago`),
    el("h3", {}, "Publishers"), el("ul", {}, ...topic.pubs.map((node) => el("li", {}, link(node, { node }, choose)))),
    el("h3", {}, "Subscribers"), el("ul", {}, ...(readers.length ? readers : [el("li", { class: "quiet" }, "none")]))];
}

function ofNode(name, choose) {
  const node = store.nodes.find((each) => each.name === name), health = store.rates.nodes[name];
  const topics = (end) => store.topics.filter((each) => each[end].includes(name)).map((each) => {
    const lost = end === "subs" ? health?.inputs[each.name]?.[1] ?? 0 : 0;
    const said = [end === "pubs" ? rate(store.rates.topics[each.name], each) : "", lost ? `${lost} lost` : ""].filter(Boolean).join(", ");
    return el("li", {}, link(each.name, { topic: each.name }, choose), el("small", { class: lost ? "bad" : "quiet" }, said));
  });
  // What is refused on keys that are no topics, as those of lockstep.
  const beside = Object.entries(health?.inputs ?? {}).filter(([key, counts]) => counts[2] && !store.topics.some((each) => each.name === key));
  const served = store.services.filter((each) => each.node === name).map((each) => el("li", {}, each.name));
  return [close(choose), el("h2", {}, name), fact("kind", node?.kind || "external"),
    ...(health ? [fact("state", health.state), fact("heartbeat", `${health.age.toFixed(1)} s ago`, health.age > 3 ? "bad" : ""), fact("pid", String(health.pid)), ...(health.note ? [fact("detail", health.note)] : [])] : [fact("heartbeat", "none received")]),
    ...(health?.refused_requests ? [fact("requests", `${health.refused_requests} refused: ${health.request_reason}`, "bad")] : []),
    ...beside.map(([key, counts]) => fact(key, `${counts[2]} refused: ${counts[4]}`, "bad")),
    el("h3", {}, "Publishes"), el("ul", {}, ...topics("pubs")), el("h3", {}, "Subscribes to"), el("ul", {}, ...topics("subs")),
    ...(served.length ? [el("h3", {}, "Serves"), el("ul", {}, ...served)] : [])];
}

const link = (text, what, choose) => el("button", { class: "link", onclick: () => choose(what) }, text);
