// The processes of the fleet, with what may be done to each.

import { confirmButton, el, notify, setText, whilePending } from "./dom.js";
import { ownFirst, store } from "./store.js";

const KINDS = { ready: "good", starting: "warn", waiting: "warn", "backing off": "bad", failed: "bad", stopping: "warn", stopped: "off", finished: "off" };

export function startProcesses(link) {
  const body = el("tbody");
  const empty = el("p", { class: "hint" }, "No supervisor is in sight: these processes were started by hand.");
  const element = el("div", { class: "view processes" }, el("div", { class: "scroll" },
    el("table", {}, el("thead", {}, el("tr", {}, ...["Process", "State", "Pid", "Restarts", "CPU", "Memory", "Heartbeat", ""].map((each) => el("th", {}, each)))), body), empty));
  const rows = new Map();

  const order = (verb, name) => {
    const { start, restart, stop } = rows.get(name);
    return whilePending([start, restart, stop], link.call({ k: "process", verb, name }))
      .then(({ text }) => notify(text), (error) => notify(error.message, "bad"));
  };

  function row(name) {
    const cells = { state: el("span"), pid: el("td", { class: "num" }), restarts: el("td", { class: "num" }), cpu: el("td", { class: "num" }), memory: el("td", { class: "num" }), beat: el("td", { class: "quiet" }), reason: el("small", { class: "quiet" }) };
    cells.start = el("button", { class: "small", onclick: () => order("start", name) }, "Start");
    cells.restart = confirmButton("Restart", () => order("restart", name), { class: "small" });
    cells.stop = confirmButton("Stop", () => order("stop", name), { class: "small" });
    cells.row = el("tr", {}, el("td", {}, el("b", {}, name)), el("td", {}, cells.state, cells.reason), cells.pid, cells.restarts, cells.cpu, cells.memory, cells.beat,
      el("td", { class: "actions" }, cells.start, cells.restart, cells.stop));
    cells.row.dataset.process = name;
    return cells;
  }

  function fill({ state, usage }) {
    const processes = ownFirst(state?.processes ?? [], (each) => each.name);
    empty.hidden = processes.length > 0;
    for (const [name, { row: shown }] of rows) if (!processes.some((each) => each.name === name)) { shown.remove(); rows.delete(name); }
    processes.forEach((process, index) => {
      if (!rows.has(process.name)) rows.set(process.name, row(process.name));
      if (body.children[index] !== rows.get(process.name).row) body.insertBefore(rows.get(process.name).row, body.children[index] ?? null);
      const [cpu, memory] = usage[process.name] ?? [];
      const cells = rows.get(process.name), runs = !["stopped", "finished", "failed"].includes(process.state);
      setText(cells.state, process.state);
      cells.state.className = `badge ${KINDS[process.state] ?? ""}`;
      setText(cells.pid, process.pid ? String(process.pid) : "–");
      setText(cells.restarts, String(process.restarts));
      setText(cells.reason, process.reason);
      cells.start.hidden = runs;
      cells.stop.hidden = cells.restart.hidden = !runs;
      setText(cells.cpu, cpu === undefined ? "–" : `${cpu.toFixed(cpu < 10 ? 1 : 0)} %`);
      setText(cells.memory, memory === undefined ? "–" : `${memory} MiB`);
    });
  }

  function beats() {
    for (const [name, { beat }] of rows) {
      const health = store.rates.nodes[`/${name}`];
      setText(beat, health ? `${health.age < 1.6 ? "" : `${health.age.toFixed(0)} s ago · `}${health.state}${health.note ? ` · ${health.note}` : ""}` : "–");
      beat.classList.toggle("bad", Boolean(health && health.age > 3));
    }
  }

  link.on("fleet", fill);
  link.on("rates", beats);
  return {
    element,
    show() { link.subscribe("processes", { channels: ["fleet", "rates"] }); },
    hide() { link.subscribe("processes", {}); },
  };
}
