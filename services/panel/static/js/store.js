// What several parts of the page know in common: the graph's topics, the robots with their colours and those that are
// `free`, and the sets of parameters.

export const store = { topics: [], nodes: [], services: [], robots: [], free: [], rates: { nodes: {}, topics: {} }, sets: new Map(), values: new Map() };

export function startStore(link) {
  link.on("graph", (graph) => {
    store.topics = graph.topics;
    store.nodes = graph.nodes;
    store.services = graph.srvs;
  });
  link.on("robots", ({ robots, free }) => { store.robots = robots; store.free = free ?? []; });
  link.on("rates", (rates) => { store.rates = rates; });
  link.on("sets", ({ sets }) => { store.sets = new Map(sets.map((each) => [each.set, each])); });
  link.on("values", ({ sets }) => { for (const each of sets) store.values.set(each.set, each); });
}

// The robots' processes, topics and sets, and the user's own, before Elea's own, each group in its own order.
const BUILTIN_NODES = ["router", "sim", "params", "grader", "logger", "panel", "recorder", "state", "player", "supervisor"];
const GLOBAL_TOPICS = ["clock", "e_stop", "health", "rosout", "tf", "tf_static", "gazebo"];

export function ownFirst(items, name) {
  const builtin = (item) => {
    const first = name(item).replace(/^\//, "").split("/")[0];
    return BUILTIN_NODES.includes(first) || GLOBAL_TOPICS.includes(first);
  };
  return [...items.filter((item) => !builtin(item)), ...items.filter(builtin)];
}

// A live parameter by its name, in the first set whose name fits: its set, description and value.
export function findParameter(name, fits) {
  for (const [set, schema] of store.sets) {
    const description = schema.parameters.find((each) => each.name === name && each.live);
    if (description && fits(set)) {
      return { set, description, value: store.values.get(set)?.values.find((each) => each.name === name)?.value };
    }
  }
  return null;
}
