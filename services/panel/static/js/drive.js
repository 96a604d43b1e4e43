// Driving: a stick on the screen and keys, each for as long as it is held. The panel stops the robot when this page
// falls silent; here everything that could leave a key stuck lets go as well.

import { el, notify, robotName, setText, show, storage, twoDecimals } from "./dom.js";

const PERIOD = 50; // ms between two commands while the stick or a key is held
const KEYS = {
  i: [1, 0], w: [1, 0], ArrowUp: [1, 0],
  ",": [-1, 0], s: [-1, 0], x: [-1, 0], ArrowDown: [-1, 0],
  j: [0, 1], a: [0, 1], ArrowLeft: [0, 1],
  l: [0, -1], d: [0, -1], ArrowRight: [0, -1],
  u: [1, 1], o: [1, -1], m: [-1, -1], ".": [-1, 1],
};

export function startDrive(link, chosen) {
  const held = new Map(); // by the key's place on the keyboard: with Shift in between, its name is another when it goes up
  let enabled = false, stick = null, timer = 0, limits = { v: 1, w: 3 };

  const speed = el("input", { type: "range", min: 0.05, max: 1, step: 0.01, value: storage.get("speed", 0.2), "aria-label": "Speed", oninput: () => shown() });
  const turn = el("input", { type: "range", min: 0.1, max: 3, step: 0.05, value: storage.get("turn", 1), "aria-label": "Turn rate", oninput: () => shown() });
  const speedText = el("span", { class: "num" }), turnText = el("span", { class: "num" });
  const knob = el("div", { class: "knob" });
  const pad = el("div", { class: "pad", id: "stick", title: "Drag and hold to drive" }, knob);
  const why = el("small", { class: "quiet" });
  const title = el("b", {}), motion = el("span", { class: "num quiet" });
  const element = el("section", { class: "drive" },
    el("div", { class: "line" }, title, el("span", { class: "fill" }), motion),
    why, el("div", { class: "drive-body" }, pad, el("div", { class: "sliders" },
      el("label", {}, el("span", { class: "line" }, "Speed", el("span", { class: "fill" }), speedText), speed),
      el("label", {}, el("span", { class: "line" }, "Turn", el("span", { class: "fill" }), turnText), turn),
      el("small", { class: "quiet keys" }, el("span", {}, "Hold W A S D or the arrows,"), el("span", {}, "or u i o  j l  m , . to drive by keys")))));

  function shown() {
    setText(speedText, `${Number(speed.value).toFixed(2)} m/s`);
    setText(turnText, `${Number(turn.value).toFixed(2)} rad/s`);
    storage.set("speed", Number(speed.value));
    storage.set("turn", Number(turn.value));
  }

  // What stick and keys command, as shares of the two speeds; null when neither is held.
  function command() {
    if (stick) return stick;
    if (!held.size) return null;
    let v = 0, w = 0;
    for (const [ahead, left] of held.values()) { v += ahead; w += left; }
    return [Math.max(-1, Math.min(1, v)), Math.max(-1, Math.min(1, w))];
  }

  function sendCommand() {
    const share = command(), robot = chosen();
    if (!share || !robot?.drives) { release(); return; }
    const v = share[0] * Number(speed.value), w = share[1] * Number(turn.value);
    link.send({ k: "drive", robot: robot.ns, v: Number(v.toFixed(3)), w: Number(w.toFixed(3)) });
    setText(motion, `${twoDecimals(v)} m/s, ${twoDecimals(w)} rad/s`);
    if (!timer) timer = setInterval(sendCommand, PERIOD);
  }

  function release() {
    held.clear();
    stick = null;
    knob.style.transform = "";
    pad.classList.remove("held");
    setText(motion, "");
    if (!timer) return;
    clearInterval(timer);
    timer = 0;
    link.send({ k: "release" });
  }

  const typing = (target) => target.closest?.("input:not([type=range]):not([type=checkbox]), select, textarea");
  window.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!enabled || !(key in KEYS) || event.ctrlKey || event.metaKey || event.altKey || typing(event.target)) return;
    event.preventDefault();
    if (event.repeat) return;
    if (!chosen()?.drives) { notify("choose a robot that drives"); return; }
    if (event.target.matches?.("input")) event.target.blur();
    held.set(event.code, KEYS[key]);
    sendCommand();
  });
  window.addEventListener("keyup", (event) => {
    if (event.key === "Meta") release(); // macOS sends no keyup for other keys meanwhile
    else if (held.delete(event.code)) sendCommand();
  });
  for (const kind of ["blur", "pagehide", "contextmenu"]) window.addEventListener(kind, release);
  document.addEventListener("visibilitychange", () => { if (document.hidden) release(); });
  link.on("link", ({ open }) => { if (!open) release(); });

  function follow(event) {
    const box = pad.getBoundingClientRect(), radius = box.width / 2;
    let dx = (event.clientX - box.left - radius) / radius, dy = (event.clientY - box.top - radius) / radius;
    const far = Math.hypot(dx, dy);
    if (far > 1) { dx /= far; dy /= far; }
    knob.style.transform = `translate(${dx * radius * 0.6}px, ${dy * radius * 0.6}px)`;
    const dead = (value) => (Math.abs(value) < 0.12 ? 0 : value);
    stick = [dead(-dy), dead(-dx)];
  }
  pad.addEventListener("pointerdown", (event) => {
    if (!chosen()?.drives) return;
    pad.setPointerCapture(event.pointerId);
    pad.classList.add("held");
    follow(event);
    sendCommand();
  });
  pad.addEventListener("pointermove", (event) => { if (stick) follow(event); });
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(kind, release);

  link.on("about", ({ limits: announced }) => {
    if (announced.v === limits.v && announced.w === limits.w) return;
    limits = announced;
    speed.max = announced.v;
    turn.max = announced.w;
    shown();
  });
  link.on("error", ({ reason }) => { if (timer) notify(reason, "bad"); });
  shown();
  return {
    element,
    release,
    enable(on) { enabled = on; if (!on) release(); },
    choose(robot) {
      setText(title, robot ? `Drive ${robotName(robot.ns)}` : "Drive");
      const reason = !robot ? "Choose a robot first." : robot.drives ? "" : `${robotName(robot.ns)} cannot be driven: it does not subscribe to cmd_vel.`;
      setText(why, reason);
      show(why, Boolean(reason));
      speed.disabled = turn.disabled = Boolean(reason);
      element.classList.toggle("off", Boolean(reason));
    },
  };
}
