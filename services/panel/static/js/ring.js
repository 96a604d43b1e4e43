// A bounded history of one series: times rise, the oldest samples make room for the newest.

export const MOST = 32768; // samples: 11 min at 50 Hz, 512 kB

export class Ring {
  constructor(most = MOST) {
    this.most = most;
    this.clear();
  }

  clear() {
    this.times = new Float64Array(1024);
    this.values = new Float64Array(1024);
    this.start = 0; // the oldest sample that is kept lies here
    this.end = 0;
    this.gone = 0; // samples that lay before the arrays' beginning
  }

  get length() { return this.end - this.start; }
  get last() { return this.end > this.start ? this.times[this.end - 1] : -Infinity; }
  get first() { return this.end > this.start ? this.times[this.start] : Infinity; }
  get newest() { return this.end > this.start ? this.values[this.end - 1] : undefined; }

  push(times, values) {
    for (let i = 0; i < times.length; i++) {
      const t = times[i];
      if (t <= this.last) {
        if (t < this.last - 1) this.clear(); // time began again
        else continue; // sent twice, or late
      }
      if (this.end === this.times.length) this.makeRoom();
      this.times[this.end] = t;
      this.values[this.end++] = values[i];
      if (this.end - this.start > this.most) this.start++;
    }
  }

  // Moving half of it costs once in many samples; the arrays grow to twice what is kept and no further.
  makeRoom() {
    const grown = Math.min(2 * this.most, 2 * this.times.length);
    const [times, values] = grown > this.times.length
      ? [new Float64Array(grown), new Float64Array(grown)] : [this.times, this.values];
    times.set(this.times.subarray(this.start, this.end));
    values.set(this.values.subarray(this.start, this.end));
    this.end -= this.start;
    this.gone += this.start;
    this.start = 0;
    this.times = times;
    this.values = values;
  }

  // The first sample at or after t.
  at(t) {
    let low = this.start, high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}
