// The series that are followed: each field of a topic once, with its history, whichever plots show it.

import { Ring } from "./ring.js";

export class Series {
  constructor(link) {
    this.link = link;
    this.all = new Map(); // "topic path" -> {id, topic, path, ring, users}
    this.byId = new Map();
    this.number = 0;
    this.epoch = null;
    this.fresh = false;
    link.on("epoch", (epoch) => {
      if (this.epoch !== null && epoch !== this.epoch) for (const each of this.all.values()) each.ring.clear();
      this.epoch = epoch;
    });
    link.on("samples", ({ id, times, values }) => {
      this.byId.get(id)?.ring.push(times, values);
      this.fresh = true;
    });
  }

  has(topic, path) { return this.all.has(`${topic} ${path}`); }

  open(topic, path) {
    const key = `${topic} ${path}`;
    let series = this.all.get(key);
    if (!series) {
      series = { id: ++this.number, key, topic, path, ring: new Ring(), users: 0, unit: "" };
      this.all.set(key, series);
      this.byId.set(series.id, series);
    }
    series.users++;
    this.updateSubscription();
    return series;
  }

  close(series) {
    if (--series.users === 0) {
      this.all.delete(series.key);
      this.byId.delete(series.id);
      this.updateSubscription();
    }
  }

  // Take the units of series, by their ids; whether any is new.
  label(units) {
    let changed = false;
    for (const [id, unit] of Object.entries(units)) {
      const series = this.byId.get(Number(id));
      if (series && series.unit !== unit) { series.unit = unit; changed = true; }
    }
    return changed;
  }

  get last() {
    let last = -Infinity;
    for (const { ring } of this.all.values()) last = Math.max(last, ring.last);
    return last;
  }

  // Samples are asked for in any case: a plot that is looked at again has its history.
  updateSubscription() {
    const series = [...this.all.values()].map(({ id, topic, path }) => ({ id, topic, path }));
    this.link.subscribe("series", { series });
  }
}
