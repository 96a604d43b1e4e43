// The socket to the panel: subscriptions and requests out, messages in; each request has a deadline.

const DEADLINE = 32000; // ms; the panel's own, 30 s at most, is shorter, and names the reason
const MAGIC = 0x31454c45;

export class Link {
  constructor() {
    this.listeners = new Map();
    this.pending = new Map();
    this.subscriptions = new Map();
    this.number = 0;
    this.lastSent = "";
    this.open = this.accepted = false;
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
      this.lastSent = "";
      this.sendSubscriptions();
    };
    socket.onmessage = (event) => {
      if (!this.accepted) this.onAccepted();
      this.receive(event.data);
    };
    socket.onclose = (event) => this.onClose(event);
  }

  // An open socket is not accepted yet: with too many pages the panel opens, gives the reason, and closes.
  onAccepted() {
    this.accepted = true;
    this.retry = 300;
    this.emit("link", { open: true });
  }

  // Set what one part of the page shows: {channels, series, fields, scan}; those of all parts are sent as one.
  subscribe(part, subscription) {
    this.subscriptions.set(part, subscription);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.sendSubscriptions(), 20);
  }

  // Send a request; resolves to its result, rejects with the reason.
  call(request) {
    return new Promise((resolve, reject) => {
      if (!this.open) { reject(new Error("not connected")); return; }
      const id = ++this.number;
      const timer = setTimeout(() => {
        this.pending.delete(id);
        reject(new Error(`no answer within ${DEADLINE / 1000} s`));
      }, DEADLINE);
      this.pending.set(id, { resolve, reject, timer });
      this.socket.send(JSON.stringify({ ...request, id }));
    });
  }

  // Send what has no answer; false when it could not be sent at once, so that nothing old piles up.
  send(message) {
    if (!this.open || this.socket.bufferedAmount > 4096) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  sendSubscriptions() {
    const channels = new Set(), series = [], fields = new Set();
    let scan = "";
    for (const each of this.subscriptions.values()) {
      each.channels?.forEach((name) => channels.add(name));
      each.fields?.forEach((name) => fields.add(name));
      if (each.series) series.push(...each.series);
      scan = each.scan || scan;
    }
    const text = JSON.stringify({ k: "subscribe", channels: [...channels], series, fields: [...fields], scan });
    if (this.open && text !== this.lastSent) {
      this.lastSent = text;
      this.socket.send(text);
    }
  }

  receive(data) {
    if (data instanceof ArrayBuffer) { this.receiveSamples(data); return; }
    const message = JSON.parse(data);
    if (message.k === "reply") {
      const request = this.pending.get(message.id);
      if (!request) return;
      this.pending.delete(message.id);
      clearTimeout(request.timer);
      if (message.ok) request.resolve(message.result);
      else request.reject(new Error(message.result));
      return;
    }
    this.emit(message.k, message);
  }

  receiveSamples(buffer) {
    const head = new Uint32Array(buffer, 0, 4);
    if (head[0] !== MAGIC) return;
    this.emit("epoch", head[1]);
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

  async onClose(event) {
    this.open = this.accepted = false;
    for (const { reject, timer } of this.pending.values()) {
      clearTimeout(timer);
      reject(new Error("the connection was lost"));
    }
    this.pending.clear();
    this.emit("link", { open: false, reason: event.reason || await this.closeReason() });
    setTimeout(() => this.start(), this.retry);
    this.retry = Math.min(4000, this.retry * 1.7);
  }

  async closeReason() {
    try {
      const answer = await fetch("/session", { signal: AbortSignal.timeout(2000) });
      if (answer.status === 401) return "This page's token is no longer valid: open the address that ./elea panel prints.";
    } catch { /* nobody there */ }
    return "No connection to the panel; reconnecting.";
  }
}
