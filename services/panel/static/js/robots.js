// The view of robots: the map, the list of robots with their stops, goals, and the stick.

import { el, notify, perFrame, robotName, setEnabled, setText, show, storage, twoDecimals, whilePending } from "./dom.js";
import { startDrive } from "./drive.js";
import { GroundMap } from "./map.js";

const TEXT_PERIOD = 200; // ms between two changes of the poses in the list
const MANY = 8; // robots; a list of more has a filter, and a line for each

export function startRobots(link) {
  let robots = [], selected = "", aiming = false, visible = false, epoch = null, poses = {}, texts = 0;

  const draw = perFrame(() => { if (visible) ground.draw(); });
  const ground = new GroundMap({ select, aims: () => aiming && Boolean(selected), goal, redraw() { if (visible) draw(); } });
  const goalButton = el("button", { id: "goal-mode", title: "Then click where the robot should go; drag to set its final heading (Esc cancels)", onclick: () => aim(!aiming) }, "Send goal");
  const laserButton = el("button", { id: "laser", title: "Show what the laser of the chosen robot sees", onclick: () => {
    storage.set("laser", !storage.get("laser", true));
    subscribe();
  } }, "Laser");
  const hint = el("span", { class: "quiet hint-line" });
  const list = el("div", { class: "robots", id: "robots" });
  const filter = el("input", { type: "search", class: "list-filter", placeholder: "Filter robots", "aria-label": "Filter robots", hidden: true, oninput: () => refresh() });
  const rows = new Map();
  const drive = startDrive(link, () => robots.find((each) => each.ns === selected));
  const element = el("div", { class: "view robots-view" },
    el("div", { class: "ground-box" },
      el("div", { class: "toolbar over" }, goalButton,
        el("button", { onclick: () => ground.fit() }, "Fit"),
        el("button", { onclick: () => ground.clear() }, "Clear trails"), laserButton, hint),
      ground.canvas),
    el("aside", { class: "pane side" }, filter, list, drive.element));

  // The laser is computed for those who look at it alone.
  function subscribe() {
    const laser = storage.get("laser", true);
    laserButton.setAttribute("aria-pressed", String(laser));
    if (!laser || ground.world.scan?.ns !== selected) ground.setScan(null);
    link.subscribe("map", visible ? { channels: ["poses", "world", "bodies", "markers"], scan: laser ? selected : "" } : {});
  }

  function select(ns) {
    if (ns === selected) return;
    drive.release();
    selected = ground.selected = ns;
    ground.dirty = true;
    subscribe();
    refresh();
    rows.get(ns)?.row.scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  function aim(on) {
    const robot = robots.find((each) => each.ns === selected);
    if (on && !robot?.goals) { notify(robot ? `${selected} takes no goals: no waypoint service runs for it` : "Choose a robot first", "bad"); on = false; }
    aiming = on;
    if (on) ground.touched = true; // the view stays: a click means what is seen
    goalButton.setAttribute("aria-pressed", String(aiming));
    ground.canvas.classList.toggle("aiming", aiming);
    refresh();
  }

  function goal(x, y, yaw) {
    const round = (value) => Math.round(value * 1000) / 1000;
    whilePending([goalButton], link.call({ k: "goal", robot: selected, x: round(x), y: round(y), yaw: round(yaw) })).then((text) => notify(text), (error) => notify(error.message, "bad"));
  }

  function makeRow(ns) {
    const parts = { pose: el("span", { class: "num quiet" }), state: el("span", { class: "state" }) };
    parts.swatch = el("i", { class: "swatch" });
    parts.stop = el("button", { class: "stop small", title: ns === "/" ? "Stop all robots until they are reset: this robot's e_stop is /e_stop, which stops all" : "Stop this robot until it is reset", "aria-label": `Stop ${robotName(ns)}`, onclick: (event) => { event.stopPropagation(); setStop(ns, true); } }, "Stop");
    parts.reset = el("button", { class: "small", title: "Let this robot move again", "aria-label": `Reset ${robotName(ns)}`, onclick: (event) => { event.stopPropagation(); setStop(ns, false); } }, "Reset");
    parts.name = el("button", { class: "bare pick", title: "Choose this robot, to drive it or send it to a goal" }, robotName(ns));
    parts.row = el("div", { class: "robot", onclick: () => select(ns) },
      el("div", { class: "line" }, parts.swatch, parts.name, parts.model = el("small", { class: "quiet" }), el("span", { class: "fill" }), parts.reset, parts.stop),
      el("div", { class: "line" }, parts.state, el("span", { class: "fill" }), parts.pose));
    parts.row.dataset.robot = ns;
    return parts;
  }

  // A stop is never greyed; its reset is, until it is answered.
  const setStop = (robot, on) => whilePending(on ? [] : [rows.get(robot).reset], link.call({ k: "estop", robot, on })).then((text) => notify(text, on ? "stop" : ""), (error) => notify(error.message, "bad"));

  function refresh() {
    const gone = !robots.some((each) => each.ns === selected);
    if (gone) { drive.release(); ground.aim = null; } // a held key or stick, or a goal being aimed, is not the next one's
    if (gone) selected = ground.selected = (robots.find((each) => each.goals) ?? robots.find((each) => each.drives) ?? robots[0])?.ns ?? "";
    if (gone) subscribe();
    const there = new Set(robots.map((each) => each.ns));
    for (const [ns, parts] of rows) if (!there.has(ns)) { parts.row.remove(); rows.delete(ns); }
    const many = robots.length > MANY, wanted = many ? filter.value.trim().toLowerCase() : "";
    show(filter, many);
    list.classList.toggle("many", many);
    robots.forEach((robot, index) => {
      if (!rows.has(robot.ns)) rows.set(robot.ns, makeRow(robot.ns));
      const parts = rows.get(robot.ns);
      if (list.children[index] !== parts.row) list.insertBefore(parts.row, list.children[index] ?? null);
      const [text, kind] = stateText(robot);
      show(parts.row, !wanted || `${robotName(robot.ns)} ${robot.model} ${text}`.toLowerCase().includes(wanted));
      if (parts.colour !== robot.colour) parts.swatch.style.background = parts.colour = robot.colour;
      setText(parts.model, robot.model);
      setText(parts.state, text);
      if (parts.kind !== kind) parts.state.className = `state ${parts.kind = kind}`;
      if (parts.chosen !== (robot.ns === selected)) parts.name.setAttribute("aria-pressed", String(parts.chosen = robot.ns === selected));
      parts.row.classList.toggle("chosen", robot.ns === selected);
      parts.row.classList.toggle("is-stopped", robot.stopped);
      show(parts.reset, robot.stopped || robot.asked);
      show(parts.stop, robot.stops);
    });
    if (gone && selected) rows.get(selected).row.scrollIntoView({ block: "nearest", inline: "nearest" });
    if (!robots.length && !list.children.length) list.append(el("p", { class: "hint" }, "No robots found."));
    if (robots.length) list.querySelector(".hint")?.remove();
    const robot = robots.find((each) => each.ns === selected);
    setText(hint, aiming ? `Click the goal of ${robotName(selected)}; drag to set its final heading.` : "");
    setEnabled(goalButton, robot?.goals ? "" : robot ? `${robotName(selected)} takes no goals: no waypoint service runs for it` : "Choose a robot first");
    drive.choose(robot);
    showPoses();
  }

  function stateText(robot) {
    const others = robot.stopped_by.join(", ");
    if (robot.stopped && robot.asked) return [others ? `stopped, also by ${others}` : "stopped", "bad"];
    if (robot.stopped) return [`stopped by ${others || "another node"}`, "bad"];
    if (robot.asked) return [robot.drives ? "stop sent, not confirmed" : "stopped", "bad"];
    if (robot.colliding) return ["touches something", "bad"];
    const goals = robot.plan.length ? ` ${Math.min(robot.index + 1, robot.plan.length)} of ${robot.plan.length}` : "";
    const by = robot.source && !robot.source.startsWith(`${robot.ns}/`) ? ` · obeys ${robot.source}` : "";
    if (robot.state && robot.state !== "idle") return [`${robot.state}${robot.state === "driving" ? goals : ""}${by}`, robot.state === "waiting" ? "warn" : ""];
    return [robot.source ? `obeys ${robot.source}` : robot.drives ? "at rest" : "does not drive", ""];
  }

  link.on("robots", (message) => { robots = message.robots; ground.setRobots(robots); refresh(); });
  link.on("poses", ({ at }) => {
    poses = at;
    ground.setPoses(at);
    showPoses();
  });
  link.on("world", ({ bodies }) => ground.setBodies(bodies));
  link.on("bodies", ({ outlines }) => ground.setOutlines(outlines));
  link.on("markers", (message) => ground.setMarkers(message));
  link.on("scan", (scan) => { if (scan.ns === selected && storage.get("laser", true)) ground.setScan(scan); });
  link.on("clock", (clock) => { if (epoch !== null && clock.epoch !== epoch) { ground.clear(); ground.setScan(null); } epoch = clock.epoch; });
  window.addEventListener("keydown", (event) => { if (event.key === "Escape" && aiming) aim(false); });

  // Write the newest poses into the list within TEXT_PERIOD.
  function showPoses() {
    if (visible && !texts) texts = setTimeout(writePoses, TEXT_PERIOD);
  }

  function writePoses() {
    texts = 0;
    for (const { ns, drives } of robots) {
      if (robots.length > MANY && ns !== selected) continue; // the map shows where the others are
      const [x, y, , , , , speed] = poses[ns] ?? [];
      if (x !== undefined) setText(rows.get(ns).pose, `${twoDecimals(x)}, ${twoDecimals(y)} m${drives ? ` · ${twoDecimals(speed)} m/s` : ""}`);
    }
  }

  return {
    element,
    map: ground,
    show() { visible = true; ground.dirty = true; showPoses(); subscribe(); drive.enable(true); },
    hide() { visible = false; aim(false); subscribe(); drive.enable(false); },
  };
}
