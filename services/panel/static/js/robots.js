// The view of robots: the map, the list of robots with their stops, goals, and the stick.

import { allow, el, note, robotName, say, show, whileAsking } from "./dom.js";
import { startDrive } from "./drive.js";
import { GroundMap } from "./map.js";

export function startRobots(link) {
  let robots = [], selected = "", aiming = false, visible = false, era = null, poses = {};

  const ground = new GroundMap({ select, aims: () => aiming && Boolean(selected), goal });
  const goalButton = el("button", { id: "goal-mode", title: "Then click where the robot is to go; drag to say which way it is to look (Esc ends it)", onclick: () => aim(!aiming) }, "Send goal");
  const hint = el("span", { class: "quiet hint-line" });
  const list = el("div", { class: "robots", id: "robots" });
  const rows = new Map();
  const drive = startDrive(link, () => robots.find((each) => each.ns === selected));
  const element = el("div", { class: "view robots-view" },
    el("div", { class: "ground-box" },
      el("div", { class: "toolbar over" }, goalButton,
        el("button", { onclick: () => ground.fit() }, "Fit"),
        el("button", { onclick: () => ground.clear() }, "Clear trails"), hint),
      ground.canvas),
    el("aside", { class: "pane side" }, list, drive.element));

  function select(ns) {
    if (ns === selected) return;
    drive.release();
    selected = ground.selected = ns;
    ground.dirty = true;
    fill();
    rows.get(ns)?.row.scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  function aim(on) {
    const robot = robots.find((each) => each.ns === selected);
    if (on && !robot?.goals) { note(robot ? `${selected} takes no goals: no waypoint service runs for it` : "choose a robot first", "bad"); on = false; }
    aiming = on;
    goalButton.setAttribute("aria-pressed", String(aiming));
    ground.canvas.classList.toggle("aiming", aiming);
    fill();
  }

  function goal(x, y, yaw) {
    const round = (value) => Math.round(value * 1000) / 1000;
    whileAsking([goalButton], link.ask({ k: "goal", robot: selected, x: round(x), y: round(y), yaw: round(yaw) })).then((text) => note(text), (error) => note(error.message, "bad"));
  }

  function row(ns) {
    const parts = { pose: el("span", { class: "num quiet" }), state: el("span", { class: "state" }) };
    parts.swatch = el("i", { class: "swatch" });
    parts.stop = el("button", { class: "stop small", title: ns === "/" ? "Stop all robots until they are reset: /e_stop is theirs, too" : "Stop this robot until it is reset", "aria-label": `Stop ${robotName(ns)}`, onclick: (event) => { event.stopPropagation(); order(ns, true); } }, "Stop");
    parts.reset = el("button", { class: "small", title: "Let this robot move again", "aria-label": `Reset ${robotName(ns)}`, onclick: (event) => { event.stopPropagation(); order(ns, false); } }, "Reset");
    parts.name = el("button", { class: "bare pick", title: "Choose this robot to drive and to send" }, robotName(ns));
    parts.row = el("div", { class: "robot", onclick: () => select(ns) },
      el("div", { class: "line" }, parts.swatch, parts.name, parts.model = el("small", { class: "quiet" }), el("span", { class: "fill" }), parts.reset, parts.stop),
      el("div", { class: "line" }, parts.state, el("span", { class: "fill" }), parts.pose));
    parts.row.dataset.robot = ns;
    return parts;
  }

  // A stop is never greyed; its reset is, until it is answered.
  const order = (robot, on) => whileAsking(on ? [] : [rows.get(robot).reset], link.ask({ k: "estop", robot, on })).then((text) => note(text, on ? "stop" : ""), (error) => note(error.message, "bad"));

  function fill() {
    const gone = !robots.some((each) => each.ns === selected);
    if (gone) selected = ground.selected = (robots.find((each) => each.goals) ?? robots.find((each) => each.drives) ?? robots[0])?.ns ?? "";
    for (const [ns, parts] of rows) if (!robots.some((each) => each.ns === ns)) { parts.row.remove(); rows.delete(ns); }
    robots.forEach((robot, index) => {
      if (!rows.has(robot.ns)) rows.set(robot.ns, row(robot.ns));
      const parts = rows.get(robot.ns);
      if (list.children[index] !== parts.row) list.insertBefore(parts.row, list.children[index] ?? null);
      parts.swatch.style.background = robot.colour;
      say(parts.model, robot.model);
      const [text, kind] = condition(robot);
      say(parts.state, text);
      parts.state.className = `state ${kind}`;
      parts.name.setAttribute("aria-pressed", String(robot.ns === selected));
      parts.row.classList.toggle("chosen", robot.ns === selected);
      parts.row.classList.toggle("is-stopped", robot.stopped);
      show(parts.reset, robot.stopped || robot.asked);
      show(parts.stop, robot.stops);
    });
    if (gone && selected) rows.get(selected).row.scrollIntoView({ block: "nearest", inline: "nearest" });
    if (!robots.length && !list.children.length) list.append(el("p", { class: "hint" }, "No robots are in sight."));
    if (robots.length) list.querySelector(".hint")?.remove();
    const robot = robots.find((each) => each.ns === selected);
    say(hint, aiming ? `Click where ${robotName(selected)} is to go; drag to turn it.` : "");
    allow(goalButton, robot?.goals ? "" : robot ? `${robotName(selected)} takes no goals: no waypoint service runs for it` : "Choose a robot first");
    drive.choose(robot);
  }

  function condition(robot) {
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

  link.on("robots", (news) => { robots = news.robots; ground.know(robots); fill(); });
  link.on("poses", ({ at }) => {
    poses = at;
    ground.take(at);
  });
  link.on("clock", (clock) => { if (era !== null && clock.era !== era) ground.clear(); era = clock.era; });
  window.addEventListener("keydown", (event) => { if (event.key === "Escape" && aiming) aim(false); });

  let slow = 0;
  function frame(now) {
    if (visible) {
      ground.draw();
      if (now - slow > 200) {
        slow = now;
        for (const { ns, drives } of robots) {
          const [x, y, , , , , speed] = poses[ns] ?? [];
          if (x !== undefined) say(rows.get(ns).pose, `${x.toFixed(2)}, ${y.toFixed(2)} m${drives ? ` · ${speed.toFixed(2)} m/s` : ""}`);
        }
      }
    }
    requestAnimationFrame(frame);
  }
  requestAnimationFrame(frame);

  return {
    element,
    map: ground,
    show() { visible = true; ground.dirty = true; link.want("map", { channels: ["poses"] }); drive.enable(true); },
    hide() { visible = false; aim(false); link.want("map", {}); drive.enable(false); },
  };
}
