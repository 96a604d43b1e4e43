// How the lines of a plot are painted: colour and dashes.

import { store } from "./store.js";
import { colour } from "./theme.js";

// Lines on top of each other are distinguished by dashes: every further line is broken and shows what is below it.
export const DASHES = [[], [10, 6], [4, 4], [14, 4, 2, 4], [2, 3]];

// The robot in whose namespace a topic is. One that has no namespace of its own claims none: all topics would be its.
function robotOf(topic) {
  let found = null;
  for (const each of store.robots) {
    if (each.ns !== "/" && topic.startsWith(`${each.ns}/`) && each.ns.length > (found?.ns.length ?? 0)) found = each;
  }
  return found;
}

// Half way to grey, for lines of one colour that have gone through all dashes.
const paler = (hex) => `#${[1, 3, 5].map((at) => Math.round((parseInt(hex.slice(at, at + 2), 16) + 128) / 2).toString(16).padStart(2, "0")).join("")}`;

function ownColour(line, lines) {
  const { free } = store;
  if (!free.length) return colour("quiet"); // robots and colours are not known yet
  if (line.own === null) {
    const used = lines.filter(({ series }) => !robotOf(series.topic)).map(({ own }) => own);
    line.own = 0;
    while (used.includes(line.own)) line.own++;
  }
  return free[line.own % free.length];
}

// {stroke, dash} of each line of a plot. A robot's lines have its colour, as on the map; any other line keeps the `own`th
// of the colours that no robot has. Lines of one colour differ in their dashes.
export function strokes(lines) {
  const used = new Map(); // colour -> how many lines have it with each of the dashes
  return lines.map((line, index) => {
    const base = robotOf(line.series.topic)?.colour ?? ownColour(line, lines);
    if (!used.has(base)) used.set(base, DASHES.map(() => 0));
    const counts = used.get(base), least = Math.min(...counts);
    let dash = index % DASHES.length;
    while (counts[dash] > least) dash = (dash + 1) % DASHES.length;
    return { stroke: counts[dash]++ % 2 && base.length === 7 ? paler(base) : base, dash: DASHES[dash] };
  });
}

// The same stroke as a background, for the legend.
export function background({ stroke, dash }) {
  if (!dash.length) return stroke;
  let at = 0;
  const stops = dash.map((length, index) => `${index % 2 ? "transparent" : stroke} ${at}px ${at += length}px`);
  return `repeating-linear-gradient(to right, ${stops.join(", ")})`;
}
