// The bar at the top: simulation time and its controls, the emergency stop, what the fleet is called.

import { byId, confirmButton, notify, setEnabled, setText, show, whilePending } from "./dom.js";
import { findParameter } from "./store.js";

export function clockText(seconds) {
  const s = Math.floor(seconds), h = Math.floor(s / 3600), m = Math.floor(s / 60) % 60;
  const fraction = Math.floor((seconds - s) * 10);
  return `${h ? `${h}:` : ""}${String(m).padStart(2, "0")}:${String(s % 60).padStart(2, "0")}.${fraction}`;
}

export function startHeader(link) {
  let paused = false;
  link.subscribe("header", { channels: ["clock", "fleet", "robots", "sets", "values"] });

  const request = (message, done, ...buttons) => whilePending(buttons, link.call(message)).then(
    (answer) => { if (done) notify(typeof answer === "string" ? answer : done); },
    (error) => notify(error.message, "bad"),
  );
  byId("pause").addEventListener("click", () => request({ k: paused ? "resume" : "pause" }, "", byId("pause")));
  byId("step").addEventListener("click", () => request({ k: "step", count: Number(byId("steps").value) }, "", byId("step")));
  for (const [id, time, done] of [["reset", true, "time and world are reset"], ["reset-world", false, "the world is reset"]]) {
    const plain = byId(id);
    const button = confirmButton(plain.textContent, () => request({ k: "reset", time }, done, byId(id)), { id, title: plain.title });
    button.className = plain.className;
    plain.replaceWith(button);
  }
  byId("stop").addEventListener("click", () => request({ k: "estop", on: true }, "stop")); // never greyed: it stops, however often
  byId("stop-reset").addEventListener("click", () => request({ k: "estop", on: false }, "reset", byId("stop-reset")));

  link.on("clock", (clock) => {
    paused = clock.paused;
    setText(byId("clock"), clock.alive ? clockText(clock.t) : "no clock");
    setText(byId("factor"), !clock.alive ? "" : paused ? "paused" : clock.factor === null ? "" : `×${clock.factor.toFixed(clock.factor < 10 ? 2 : 1)}`);
    byId("dot").className = `dot ${!clock.alive ? "bad" : paused ? "warn" : "good"}`;
    setText(byId("pause"), paused ? "Resume" : "Pause");
    for (const id of ["step", "steps"]) setEnabled(byId(id), paused ? "" : "Pause first: the simulation is running");
  });
  link.on("about", ({ dropped }) => {
    setText(byId("drops"), `${dropped} messages dropped`);
    show(byId("drops"), dropped > 0);
  });
  link.on("fleet", ({ state }) => {
    setText(byId("fleet"), state ? state.fleet : "elea");
    setText(byId("mode"), state ? state.mode : "");
    document.title = state ? `${state.fleet} · Elea` : "Elea panel";
  });
  link.on("robots", ({ robots, all_stopped }) => {
    const bases = robots.filter((each) => each.drives);
    const stopped = bases.filter((each) => each.stopped).length;
    const some = stopped > 0 || all_stopped || robots.some((each) => each.asked);
    show(byId("stop-reset"), some);
    byId("stop").classList.toggle("latched", some);
    setText(byId("stop"), stopped === 0 ? "STOP" : stopped === bases.length ? "STOPPED" : `STOPPED ${stopped}/${bases.length}`);
  });
  startFactor(link);
}

// The factor of simulation time, where that keeps to the wall clock.
function startFactor(link) {
  const box = byId("factor-set");
  let mode = "real";
  const refresh = (refused = false) => {
    const found = mode === "real" ? findParameter("factor", (set) => set.includes("sim")) : null;
    show(byId("factor-box"), Boolean(found));
    if (!found) return;
    box.min = found.description.low ?? "";
    box.max = found.description.high ?? "";
    if ((document.activeElement !== box || refused) && found.value !== undefined) box.value = found.value;
  };
  link.on("sets", () => refresh());
  link.on("values", () => refresh());
  link.on("fleet", ({ state }) => { mode = state ? state.mode : "real"; refresh(); });
  box.addEventListener("change", () => {
    const found = findParameter("factor", (set) => set.includes("sim"));
    if (!found || box.value === "") { refresh(true); return; }
    link.call({ k: "set", set: found.set, values: { factor: Number(box.value) }, run: true }).catch((error) => {
      notify(error.message, "bad");
      refresh(true);
    });
  });
}
