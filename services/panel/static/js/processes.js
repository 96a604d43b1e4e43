// The processes of the fleet, with what may be done to each.

import { confirmButton, el, notify, setText, show, whilePending } from "./dom.js";
import { ownFirst, store } from "./store.js";

const KINDS = { ready: "good", starting: "warn", waiting: "warn", "backing off": "bad", failed: "bad", stopping: "warn", stopped: "off", finished: "off" };

export function startProcesses(link) {
  const body = el("tbody"), count = el("span", { class: "quiet num" });
  const filter = el("input", { type: "search", placeholder: "Filter processes", "aria-label": "Filter processes", oninput: () => applyFilter() });
  const empty = el("p", { class: "hint" }, "No supervisor found: were the processes started by hand?");
  const element = el("div", { class: "view processes" }, el("div", { class: "toolbar" }, filter, el("span", { class: "fill" }), count), el("div", { class: "scroll" },
    el("table", {}, el("thead", {}, el("tr", {}, ...["Process", "State", "Pid", "Restarts", "CPU", "Memory", "Heartbeat", ""].map((each) => el("th", {}, each)))), body), empty));
  const rows = new Map();

  const order = (verb, name) => {
    const { start, restart, stop } = rows.get(name);
    return whilePending([start, restart, stop], link.call({ k: "process", verb, name }))
      .then(({ text }) => notify(text), (error) => notify(error.message, "bad"));
  };

  function row(name) {
    const cells = { shared: [], nodes: el("small", { class: "quiet" }), state: el("span"), pid: el("td", { class: "num" }), restarts: el("td", { class: "num" }), cpu: el("td", { class: "num" }), memory: el("td", { class: "num" }), beat: el("td", { class: "quiet" }), reason: el("small", { class: "quiet" }) };
    cells.start = el("button", { class: "small", onclick: () => order("start", name) }, "Start");
    cells.restart = confirmButton("Restart", () => order("restart", name), { class: "small" });
    cells.stop = confirmButton("Stop", () => order("stop", name), { class: "small" });
    cells.row = el("tr", {}, el("td", {}, el("b", {}, name), cells.nodes), el("td", {}, cells.state, cells.reason), cells.pid, cells.restarts, cells.cpu, cells.memory, cells.beat,
      el("td", { class: "actions" }, cells.start, cells.restart, cells.stop));
    cells.row.dataset.process = name;
    return cells;
  }

  function fill({ state, usage }) {
    const processes = ownFirst(state?.processes ?? [], (each) => each.name);
    empty.hidden = processes.length > 0;
    const there = new Set(processes.map((each) => each.name));
    for (const [name, { row: shown }] of rows) if (!there.has(name)) { shown.remove(); rows.delete(name); }
    processes.forEach((process, index) => {
      if (!rows.has(process.name)) rows.set(process.name, row(process.name));
      if (body.children[index] !== rows.get(process.name).row) body.insertBefore(rows.get(process.name).row, body.children[index] ?? null);
      const [cpu, memory] = usage[process.name] ?? [];
      const cells = rows.get(process.name), runs = !["stopped", "finished", "failed"].includes(process.state);
      cells.shared = process.nodes ?? [];
      cells.nodes.hidden = cells.shared.length === 0;
      setText(cells.nodes, `${cells.shared.length} nodes: ${cells.shared.slice(0, 4).join(", ")}${cells.shared.length > 4 ? ", …" : ""}`);
      cells.nodes.title = cells.shared.join("\n");
      setText(cells.state, process.state);
      if (cells.kind !== process.state) cells.state.className = `badge ${KINDS[cells.kind = process.state] ?? ""}`;
      setText(cells.pid, process.pid ? String(process.pid) : "–");
      setText(cells.restarts, String(process.restarts));
      setText(cells.reason, process.reason);
      cells.start.hidden = runs;
      cells.stop.hidden = cells.restart.hidden = !runs;
      setText(cells.cpu, cpu === undefined ? "–" : `${cpu.toFixed(cpu < 10 ? 1 : 0)} %`);
      setText(cells.memory, memory === undefined ? "–" : `${memory} MiB`);
    });
    applyFilter();
  }

  // By name, state and reason: "failed" finds what has failed.
  function applyFilter() {
    const wanted = filter.value.trim().toLowerCase();
    let shown = 0;
    for (const [name, cells] of rows) {
      const fits = !wanted || `${name} ${cells.shared.join(" ")} ${cells.state.textContent} ${cells.reason.textContent}`.toLowerCase().includes(wanted);
      show(cells.row, fits);
      shown += fits;
    }
    setText(count, wanted ? `${shown} of ${rows.size} processes` : `${rows.size} processes`);
  }

  function beats() {
    for (const [name, { beat, shared }] of rows) {
      // Of a process that several nodes share, the one that has been silent longest.
      const known = (shared.length ? shared : [`/${name}`]).map((node) => store.rates.nodes[node]).filter(Boolean);
      const health = known.length ? known.reduce((last, each) => (each.age > last.age ? each : last)) : undefined;
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
