// The view of plots: which there are, the stretch of time that they share, the fields to choose, the parameters.

import { startChooser } from "./chooser.js";
import { el, perFrame, setEnabled, storage } from "./dom.js";
import { startParameters } from "./parameters.js";
import { Plot } from "./plot.js";
import { Series } from "./series.js";
import { store } from "./store.js";
import { onTheme } from "./theme.js";

const WINDOWS = [5, 10, 30, 60, 300];

export function startPlots(link) {
  const redraw = perFrame(frame);
  const series = new Series(link);
  const stack = el("div", { class: "stack" });
  let plots = [], active = null, visible = false, fixed = null, paused = false, span = storage.get("window", 30);
  let restored = false, busyUntil = 0, dirty = true;

  const board = {
    range: () => fixed ?? [series.last - span, series.last],
    zoomed: () => fixed !== null && !paused,
    zoom(a, b) { if (b - a > 1e-4) { fixed = [a, b]; refresh(); } },
    follow() { fixed = null; paused = false; refresh(); },
    activate(plot) {
      active = plot;
      for (const each of plots) each.element.classList.toggle("active", each === plot && plots.length > 1);
    },
    drop(plot) {
      plot.destroy();
      plots = plots.filter((each) => each !== plot);
      if (!plots.length) addPlot();
      board.activate(plots[plots.length - 1]);
      board.changed();
    },
    changed() {
      dirty = true;
      redraw();
      if (restored) storage.set("plots", plots.map((each) => each.lines.map((line) => [line.series.topic, line.series.path])));
      chooser.refresh();
    },
  };

  function addPlot(fields = []) {
    const plot = new Plot(series, board);
    plots.push(plot);
    stack.append(plot.element);
    for (const [topic, path] of fields) plot.add(topic, path);
    board.activate(plot);
    return plot;
  }

  const pause = el("button", { id: "plots-pause", title: "Freeze the plots; samples are still collected", onclick: () => {
    paused = !paused;
    fixed = paused ? board.range().slice() : null;
    refresh();
  } }, "Hold");
  const follow = el("button", { title: "Show the newest samples again (or double-click a plot)", onclick: () => board.follow() }, "Follow");
  const windows = el("select", { id: "plots-window", "aria-label": "Time window", onchange: () => {
    span = Number(windows.value);
    storage.set("window", span);
    board.follow();
  } }, ...WINDOWS.map((each) => el("option", { value: each, selected: each === span }, each < 60 ? `${each} s` : `${each / 60} min`)));
  const toggles = [["fields", "Fields"], ["parameters", "Parameters"]].map(([part, title]) => el("button", {
    id: `show-${part}`, onclick: (event) => {
      const shown = element.classList.toggle(`with-${part}`);
      if (shown && innerWidth < 900) element.classList.remove(part === "fields" ? "with-parameters" : "with-fields");
      for (const each of toggles) each.setAttribute("aria-pressed", String(element.classList.contains(`with-${each.id.slice(5)}`)));
      event.currentTarget.blur();
      storage.set("panes", [...element.classList].filter((name) => name.startsWith("with-")));
    },
  }, title));

  const chooser = startChooser(link, {
    has: (topic, path) => active?.has(topic, path) ?? false,
    toggle: (topic, path) => active?.toggle(topic, path),
  });
  const parameters = startParameters(link);
  const panes = innerWidth < 900 ? [] : storage.get("panes", innerWidth < 1200 ? ["with-fields"] : ["with-fields", "with-parameters"]);
  const element = el("div", { class: `view plots ${panes.join(" ")}` },
    el("div", { class: "toolbar" }, toggles[0], el("button", { id: "add-plot", onclick: () => { addPlot(); board.changed(); } }, "+ Plot"),
      windows, pause, follow, el("span", { class: "fill" }), toggles[1]),
    chooser.element, stack, parameters.element);
  for (const each of toggles) each.setAttribute("aria-pressed", String(panes.includes(`with-${each.id.slice(5)}`)));

  function refresh() {
    pause.setAttribute("aria-pressed", String(paused));
    setEnabled(follow, fixed === null ? "The newest samples are shown already" : "");
    dirty = true;
    redraw();
  }

  // Draws when there is news, and leaves a slow machine as much time as it takes.
  function frame(now) {
    if (!visible || !(dirty || (series.fresh && fixed === null))) return;
    if (now < busyUntil) { redraw(); return; }
    dirty = series.fresh = false;
    for (const plot of plots) plot.draw();
    busyUntil = performance.now() + Math.min(400, (performance.now() - now) * 0.7);
  }

  function restore() {
    if (restored) return;
    const kept = remembered() ?? suggested();
    if (kept === null) return;
    restored = true;
    for (const plot of plots) plot.destroy();
    plots = [];
    for (const fields of kept.length ? kept : [[]]) addPlot(fields);
    board.activate(plots[0]);
  }

  addPlot();
  refresh();
  onTheme(() => plots.forEach((each) => each.rebuild()));
  link.on("graph", restore);
  link.on("robots", () => plots.forEach((each) => each.repaint()));
  link.on("units", ({ units }) => { if (series.label(units)) plots.forEach((each) => each.rebuild()); });
  link.on("samples", () => { if (visible && fixed === null) redraw(); });
  return {
    element,
    show() { visible = dirty = true; redraw(); chooser.show(); },
    hide() { visible = false; chooser.hide(); },
  };
}

// The plots of last time, unless none of their topics is there: another fleet runs.
function remembered() {
  const kept = storage.get("plots", null);
  const there = (topic) => store.topics.some((each) => each.name === topic && each.pubs.length);
  return kept?.flat().some(([topic]) => there(topic)) ? kept : null;
}

// What most people want to see first: the arm where there is one, else how fast the robots go.
function suggested() {
  const names = store.topics.filter((each) => each.pubs.length).map((each) => each.name);
  if (!names.length) return null;
  const arm = ["reference", "joint_angle"].map((each) => `/robot_control/${each}`).filter((each) => names.includes(each));
  if (arm.length) return [arm.map((each) => [each, "data"]), [["/robot_control/error", "data"]]];
  const truths = names.filter((each) => each.endsWith("/ground_truth")).slice(0, 5);
  if (!truths.length) return null;
  return [truths.map((each) => [each, "twist.twist.linear.x"]), truths.map((each) => [each, "twist.twist.angular.z"])];
}
