// One plot: its lines, its legend, and the stretch of time that it shows.

import { el, notify, setText } from "./dom.js";
import { csv, merged } from "./merge.js";
import { background, strokes } from "./strokes.js";
import { colour } from "./theme.js";

// A number for the legend; what lies a millionth of the axis from zero is zero, and not the rounding of a double.
export const short = (value, span = 0) => {
  if (value === undefined || value === null) return "–";
  const size = Math.abs(value);
  if (size < span * 1e-6) return "0";
  return size !== 0 && (size < 0.001 || size >= 1e6) ? value.toExponential(2) : String(Number(value.toPrecision(5)));
};

// As many digits as the steps between the ticks need.
function tick(value, step) {
  if (value === null) return "";
  if (Math.abs(value) >= 1e6 || step < 1e-6) return value.toExponential(2);
  let digits = 0;
  while (digits < 8 && Math.abs(Number(step.toFixed(digits)) - step) > step * 1e-3) digits++;
  return value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1");
}

// The extent of an axis: some room around the lines, and no microscope on what stands still.
function roomy(low, high) {
  if (low === null || high === null) return [-1, 1];
  const middle = (low + high) / 2, half = Math.max((high - low) / 2, Math.abs(middle) * 1e-6, 5e-4) * 1.12;
  return [middle - half, middle + half];
}

// All plots show where the mouse points in one; a drag is for that one alone, as each would take it for its own stretch.
const pointing = (type) => type === "mousemove" || type === "mouseleave";

export class Plot {
  // `board` follows time for all plots: {range(), zoom(a, b), follow(), activate(plot), drop(plot), changed()}.
  constructor(series, board) {
    this.source = series;
    this.board = board;
    this.lines = [];
    this.chips = el("div", { class: "chips" });
    this.ground = el("div", { class: "ground" });
    this.hint = el("p", { class: "hint" }, "Choose a topic's field to plot it here.");
    this.element = el("section", { class: "plot", onpointerdown: () => board.activate(this) },
      el("header", {}, this.chips,
        el("span", { class: "tools" },
          el("button", { class: "small", title: "Save this plot's samples as CSV", onclick: () => this.save() }, "CSV"),
          el("button", { class: "small", title: "Remove this plot", onclick: () => board.drop(this) }, "×"))),
      this.ground, this.hint);
    this.sizes = new ResizeObserver(() => this.fit());
    this.sizes.observe(this.ground);
  }

  has(topic, path) { return this.lines.some(({ series }) => series.topic === topic && series.path === path); }

  toggle(topic, path) {
    const index = this.lines.findIndex(({ series }) => series.topic === topic && series.path === path);
    if (index >= 0) this.remove(index);
    else this.add(topic, path);
  }

  add(topic, path) {
    if (this.has(topic, path)) return;
    if (this.source.all.size >= 32 && !this.source.has(topic, path)) { notify("At most 32 series are drawn at once: remove one first", "bad"); return; }
    const series = this.source.open(topic, path);
    const value = el("span", { class: "num value" }, "–");
    const chip = el("span", { class: "chip", title: `${topic} ${path}` },
      el("i", { class: "swatch" }), el("span", { class: "name" }, el("bdi", {}, `${topic.slice(1)} ${path}`)), value,
      el("button", { class: "bare", title: "Remove this line", onclick: () => this.toggle(topic, path) }, "×"));
    this.chips.append(chip);
    this.lines.push({ series, own: null, chip, value });
    this.rebuild();
    this.board.changed();
  }

  remove(index) {
    const [line] = this.lines.splice(index, 1);
    line.chip.remove();
    this.source.close(line.series);
    this.rebuild();
    this.board.changed();
  }

  // The strokes as the robots are known now; whether any is new.
  painted() {
    const before = JSON.stringify(this.strokes);
    this.strokes = strokes(this.lines);
    return JSON.stringify(this.strokes) !== before;
  }

  // Robots have come that have other colours, or these lines are theirs.
  repaint() { if (this.painted()) this.rebuild(); }

  rebuild() {
    this.painted();
    this.lines.forEach(({ chip }, index) => { chip.firstElementChild.style.background = background(this.strokes[index]); });
    this.chart?.destroy();
    this.chart = null;
    this.hint.hidden = this.lines.length > 0;
    this.ground.hidden = this.lines.length === 0;
    if (!this.lines.length || !this.ground.clientWidth) return;
    this.ground.dataset.unit = this.unit();
    const axis = { stroke: colour("quiet"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1 }, font: "11px system-ui, sans-serif" };
    this.chart = new uPlot({
      width: this.ground.clientWidth,
      height: this.ground.clientHeight,
      legend: { show: false },
      padding: [8, 26, 0, 0],
      scales: { x: { time: false, range: (_, low, high) => [low, high] }, y: { range: (_, low, high) => roomy(low, high) } },
      axes: [{ ...axis, size: 28, values: (_, ticks) => ticks.map((t) => `${Number(t.toFixed(3))} s`) }, { ...axis, size: 60, label: this.unit(), labelSize: this.unit() ? 18 : 0, labelFont: axis.font, labelGap: 2, values: (_, ticks, __, ___, step) => ticks.map((each) => tick(each, step)) }],
      cursor: { sync: { key: "elea", filters: { pub: pointing } }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
      series: [{}, ...this.strokes.map((each) => ({ ...each, width: 1.5, points: { show: false } }))],
      hooks: {
        setSelect: [(chart) => {
          const { left, width } = chart.select;
          if (width > 4) this.board.zoom(chart.posToVal(left, "x"), chart.posToVal(left + width, "x"));
          if (width > 0) chart.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
        }],
        setCursor: [() => this.values()],
      },
    }, merged(this.lines.map(({ series }) => series.ring), 0, -1), this.ground);
    this.chart.over.addEventListener("dblclick", () => this.board.follow());
    this.chart.over.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [a, b] = this.board.range(), at = this.chart.posToVal(event.offsetX, "x");
      const scale = Math.exp(Math.sign(event.deltaY) * 0.18);
      this.board.zoom(at - (at - a) * scale, at + (b - at) * scale);
    }, { passive: false });
    this.draw();
  }

  draw() {
    if (!this.chart) return;
    const [a, b] = this.board.range();
    this.data = merged(this.lines.map(({ series }) => series.ring), a, b, this.data);
    this.chart.batch(() => {
      this.chart.setData(this.data, false);
      this.chart.setScale("x", { min: a, max: b });
    });
    this.values();
  }

  // The legend shows what is under the cursor, else the newest.
  values() {
    const index = this.chart?.cursor?.idx;
    const { min, max } = this.chart?.scales.y ?? {};
    const span = Number.isFinite(max - min) ? max - min : 0;
    this.lines.forEach((line, k) => {
      const value = index === null || index === undefined ? line.series.ring.newest : this.chart.data[k + 1][index];
      setText(line.value, short(value, span));
    });
  }

  // What the axis counts: the units of its lines, each once.
  unit() {
    return [...new Set(this.lines.map(({ series }) => series.unit).filter(Boolean))].join(", ");
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.ground;
    if (!width || !height) return;
    if (!this.chart) this.rebuild();
    else if (this.chart.width !== width || this.chart.height !== height) this.chart.setSize({ width, height });
  }

  save() {
    const names = this.lines.map(({ series }) => `${series.topic} ${series.path}`);
    const [a, b] = this.board.zoomed() ? this.board.range() : [];
    const text = csv(names, this.lines.map(({ series }) => series.ring), a, b);
    const url = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    el("a", { href: url, download: "elea-plot.csv" }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  }

  destroy() {
    this.sizes.disconnect();
    this.chart?.destroy();
    for (const { series } of this.lines) this.source.close(series);
    this.lines = [];
    this.element.remove();
  }
}
