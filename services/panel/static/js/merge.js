// Series with times of their own, put on one time axis: for a plot, and for a table.

const GAP = 2; // s; nothing is drawn across a longer silence
const DENSE = 3000; // samples of one series in a plot; beyond it, each n-th is drawn

// uPlot's data from a to b: the union of times, each series in between by straight lines, as it would be drawn alone.
export function merged(rings, a, b, into) {
  const n = rings.length;
  const data = into?.length === n + 1 ? into : Array.from({ length: n + 1 }, () => []);
  const heads = rings.map((ring) => Math.max(ring.start, ring.at(a) - 1));
  const ends = rings.map((ring) => Math.min(ring.end, ring.at(b) + 1));
  const strides = rings.map((_, k) => Math.max(1, Math.ceil((ends[k] - heads[k]) / DENSE)));
  let row = 0;
  for (;;) {
    let t = Infinity;
    for (let k = 0; k < n; k++) if (heads[k] < ends[k] && rings[k].times[heads[k]] < t) t = rings[k].times[heads[k]];
    if (t === Infinity) break;
    data[0][row] = t;
    for (let k = 0; k < n; k++) {
      const ring = rings[k], i = heads[k];
      if (i < ends[k] && ring.times[i] === t) {
        data[k + 1][row] = ring.values[i];
        heads[k] = i + strides[k];
      } else {
        data[k + 1][row] = between(ring, i, t);
      }
    }
    row++;
  }
  for (const column of data) column.length = row;
  return data;
}

function between(ring, i, t) {
  const before = Math.min(i, ring.end) - 1;
  if (before < ring.start || i >= ring.end) return null;
  const t0 = ring.times[before], t1 = ring.times[i];
  if (t1 - t0 > GAP) return null;
  return ring.values[before] + (ring.values[i] - ring.values[before]) * (t - t0) / (t1 - t0);
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
