// Boots the page: the link, the header, and one view per tab, of which one is visible.

import { byId, el, show } from "./dom.js";
import { startGraph } from "./graph.js";
import { startHeader } from "./header.js";
import { Link } from "./link.js";
import { startLog } from "./log.js";
import { startPlots } from "./plots.js";
import { startProcesses } from "./processes.js";
import { startRobots } from "./robots.js";
import { startStore } from "./store.js";
import { startTheme } from "./theme.js";

const link = new Link();
const views = new Map();
let current = null;

function add(name, title, view) {
  const tab = el("button", { role: "tab", id: `tab-${name}`, "aria-selected": "false", "aria-controls": `view-${name}`, onclick: () => open(name) }, title);
  view.element.hidden = true;
  view.element.id = `view-${name}`;
  view.element.setAttribute("role", "tabpanel");
  view.element.setAttribute("aria-labelledby", tab.id);
  document.querySelector(".tabs").append(tab);
  byId("views").append(view.element);
  views.set(name, { tab, ...view });
}

function open(name) {
  if (!views.has(name)) name = views.keys().next().value;
  if (current === name) return;
  const before = views.get(current);
  if (before) {
    before.element.hidden = true;
    before.tab.setAttribute("aria-selected", "false");
    before.hide?.();
  }
  current = name;
  const view = views.get(name);
  view.element.hidden = false;
  view.tab.setAttribute("aria-selected", "true");
  history.replaceState(null, "", `/#${name}`);
  view.show?.();
}

startTheme();
startStore(link);
startHeader(link);
add("robots", "Robots", startRobots(link));
add("plots", "Plots", startPlots(link));
add("graph", "Graph", startGraph(link));
add("processes", "Processes", startProcesses(link));
add("log", "Log", startLog(link));
link.on("link", ({ open: connected, reason }) => {
  const trouble = byId("trouble");
  trouble.textContent = reason ?? "";
  show(trouble, !connected);
  document.body.classList.toggle("offline", !connected);
});
window.addEventListener("hashchange", () => open(location.hash.slice(1)));
open(location.hash.slice(1)); // this also takes the token out of the address
link.start();
window.elea = { link, map: views.get("robots").map }; // for the console of a browser, and for tests
