// The socket to the panel: news in, wishes and requests out, each request with a deadline.

const DEADLINE = 8000; // ms; the panel's own is shorter, and names the reason
const MARK = 0x31454c45;

export class Link {
  constructor() {
    this.listeners = new Map();
    this.waiting = new Map();
    this.wishes = new Map();
    this.number = 0;
    this.said = "";
    this.open = this.heard = false;
    this.retry = 300;
  }

  on(kind, listener) {
    if (!this.listeners.has(kind)) this.listeners.set(kind, []);
    this.listeners.get(kind).push(listener);
  }

  start() {
    const socket = this.socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.open = true;
      this.said = "";
      this.tell();
    };
    socket.onmessage = (event) => {
      if (!this.heard) this.welcome();
      this.hear(event.data);
    };
    socket.onclose = (event) => this.lost(event);
  }

  // Open is not yet in: with too many pages the panel opens, says so, and closes.
  welcome() {
    this.heard = true;
    this.retry = 300;
    this.emit("link", { open: true });
  }

  // What one part of the page wants to see: {channels, series, fields}; all parts' wishes go out as one.
  want(part, wish) {
    this.wishes.set(part, wish);
    clearTimeout(this.telling);
    this.telling = setTimeout(() => this.tell(), 20);
  }

  // A request; resolves to its answer, rejects with the reason.
  ask(word) {
    return new Promise((resolve, reject) => {
      if (!this.open) { reject(new Error("not connected")); return; }
      const id = ++this.number;
      const timer = setTimeout(() => {
        this.waiting.delete(id);
        reject(new Error("no answer within 8 s"));
      }, DEADLINE);
      this.waiting.set(id, { resolve, reject, timer });
      this.socket.send(JSON.stringify({ ...word, id }));
    });
  }

  // Something without an answer; false when it could not leave at once, so that nothing old piles up.
  say(word) {
    if (!this.open || this.socket.bufferedAmount > 4096) return false;
    this.socket.send(JSON.stringify(word));
    return true;
  }

  tell() {
    const channels = new Set(), series = [], fields = new Set();
    for (const wish of this.wishes.values()) {
      wish.channels?.forEach((each) => channels.add(each));
      wish.fields?.forEach((each) => fields.add(each));
      if (wish.series) series.push(...wish.series);
    }
    const text = JSON.stringify({ k: "want", channels: [...channels], series, fields: [...fields] });
    if (this.open && text !== this.said) {
      this.said = text;
      this.socket.send(text);
    }
  }

  hear(data) {
    if (data instanceof ArrayBuffer) { this.samples(data); return; }
    const message = JSON.parse(data);
    if (message.k === "reply") {
      const asked = this.waiting.get(message.id);
      if (!asked) return;
      this.waiting.delete(message.id);
      clearTimeout(asked.timer);
      if (message.ok) asked.resolve(message.is);
      else asked.reject(new Error(message.is));
      return;
    }
    this.emit(message.k, message);
  }

  samples(buffer) {
    const head = new Uint32Array(buffer, 0, 4);
    if (head[0] !== MARK) return;
    this.emit("era", head[1]);
    for (let at = 16, left = head[2]; left > 0; left--) {
      const [id, count] = new Uint32Array(buffer, at, 2);
      const times = new Float64Array(buffer, at + 8, count);
      const values = new Float64Array(buffer, at + 8 + 8 * count, count);
      this.emit("samples", { id, times, values });
      at += 8 + 16 * count;
    }
  }

  emit(kind, message) {
    for (const listener of this.listeners.get(kind) ?? []) listener(message);
  }

  async lost(event) {
    this.open = this.heard = false;
    for (const { reject, timer } of this.waiting.values()) {
      clearTimeout(timer);
      reject(new Error("the connection was lost"));
    }
    this.waiting.clear();
    this.emit("link", { open: false, reason: event.reason || await this.why() });
    setTimeout(() => this.start(), this.retry);
    this.retry = Math.min(4000, this.retry * 1.7);
  }

  async why() {
    try {
      const answer = await fetch("/session", { signal: AbortSignal.timeout(2000) });
      if (answer.status === 401) return "The token of this page no longer counts: open the address that ./elea panel prints.";
    } catch { /* nobody there */ }
    return "No connection to the panel. It is tried again.";
  }
}
