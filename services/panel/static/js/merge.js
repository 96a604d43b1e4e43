// Series with times of their own, put on one time axis: for a plot, and for a table.

const GAP = 2; // s; nothing is drawn across a longer silence
const DENSE = 3000; // samples of one series in a plot; of more, each part's lowest and highest are drawn

// uPlot's data from a to b: the union of times, each series in between by straight lines, as it would be drawn alone.
export function merged(rings, a, b, into) {
  const n = rings.length;
  const data = into?.length === n + 1 ? into : Array.from({ length: n + 1 }, () => []);
  const lines = rings.map((ring) => drawn(ring, a, b)), heads = rings.map(() => 0);
  let row = 0;
  for (;;) {
    let t = Infinity;
    for (let k = 0; k < n; k++) if (heads[k] < lines[k].length) t = Math.min(t, rings[k].times[lines[k][heads[k]]]);
    if (t === Infinity) break;
    data[0][row] = t;
    for (let k = 0; k < n; k++) {
      const next = heads[k] < lines[k].length ? lines[k][heads[k]] : -1;
      if (next >= 0 && rings[k].times[next] === t) {
        data[k + 1][row] = rings[k].values[next];
        heads[k]++;
      } else {
        data[k + 1][row] = next >= 0 && heads[k] > 0 ? between(rings[k], lines[k][heads[k] - 1], next, t) : null;
      }
    }
    row++;
  }
  for (const column of data) column.length = row;
  return data;
}

// Which samples of a series are drawn from a to b, by their places. Of many, the lowest and the highest of each part, so
// that no spike is left out; parts are counted from the first sample of all, so that a plot that moves does not shimmer.
function drawn(ring, a, b) {
  const head = Math.max(ring.start, ring.at(a) - 1), end = Math.min(ring.end, ring.at(b) + 1), count = Math.max(0, end - head);
  if (count <= DENSE) return Int32Array.from({ length: count }, (_, i) => head + i);
  const size = Math.ceil((2 * count) / DENSE), places = [];
  for (let from = head; from < end;) {
    const to = Math.min(end, from + size - ((from + ring.gone) % size));
    let low = from, high = from;
    for (let i = from + 1; i < to; i++) {
      if (ring.values[i] < ring.values[low]) low = i;
      if (ring.values[i] > ring.values[high]) high = i;
    }
    places.push(Math.min(low, high));
    if (low !== high) places.push(Math.max(low, high));
    from = to;
  }
  return places;
}

function between(ring, before, next, t) {
  const silent = next - before > 1 ? ring.at(t) : next;
  if (ring.times[silent] - ring.times[silent - 1] > GAP) return null;
  const t0 = ring.times[before], t1 = ring.times[next];
  return ring.values[before] + (ring.values[next] - ring.values[before]) * (t - t0) / (t1 - t0);
}

// A table as RFC 4180 has it: a row for each time at which anything came, empty where a series has no sample.
export function csv(names, rings, a = -Infinity, b = Infinity) {
  const rows = [["time [s]", ...names].map(quoted).join(",")];
  const heads = rings.map((ring) => ring.at(a));
  for (;;) {
    let t = Infinity;
    rings.forEach((ring, k) => { if (heads[k] < ring.end && ring.times[heads[k]] < t) t = ring.times[heads[k]]; });
    if (t === Infinity || t > b) break;
    const row = rings.map((ring, k) => (heads[k] < ring.end && ring.times[heads[k]] === t ? String(ring.values[heads[k]++]) : ""));
    rows.push([t.toFixed(6), ...row].join(","));
  }
  return rows.join("\r\n") + "\r\n";
}

const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
