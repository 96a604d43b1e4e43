// The trails of robots. Of many they are kept in a picture of their own, to which each drawing of the map adds what is new.

const TRAIL = 4000; // points of a robot's trail
const TRAILS = 16000; // points of all trails; of many robots the older half of each is kept more coarsely
const APART = 0.02; // m between two of them
const FEW = 8; // trails that are drawn point by point each time
const PACE = 150; // ms between two drawings of all points while the view moves

export class TrailLayer {
  constructor() {
    this.trails = new Map(); // namespace -> [x, y, x, y, …], of which `added` points are not in the picture yet
    this.picture = document.createElement("canvas");
    this.view = "";
    this.drawnAt = 0;
  }

  add(poses) {
    const entries = Object.entries(poses), most = 2 * Math.min(TRAIL, Math.ceil(TRAILS / entries.length));
    for (const [ns, [x, y]] of entries) {
      let trail = this.trails.get(ns);
      if (!trail) this.trails.set(ns, trail = Object.assign([], { added: 0 }));
      const n = trail.length, step = n ? Math.hypot(x - trail[n - 2], y - trail[n - 1]) : Infinity;
      if (step > 1 && n) { trail.length = trail.added = 0; this.view = ""; } // it was moved, or reset
      if (step > APART) { trail.push(x, y); trail.added++; }
      if (trail.length > most) thin(trail);
    }
  }

  keep(robots) {
    for (const ns of this.trails.keys()) if (!robots.has(ns)) { this.trails.delete(ns); this.view = ""; }
  }

  clear() { this.trails.clear(); this.view = ""; }

  // Draws the trails; whether they are to be drawn again soon, as the picture was only moved along with the view.
  // `colours` has the colour of each trail, or nothing for one that is not drawn.
  draw(context, camera, colours) {
    context.globalAlpha = 0.55;
    let late = false;
    if (this.trails.size <= FEW) {
      for (const [ns, trail] of this.trails) stroke(context, camera, trail, 0, colours(ns));
    } else {
      late = !this.extend(camera, colours);
      const { x, y, scale, width, height } = this.shown, grown = camera.scale / scale;
      const [left, top] = camera.toScreen(x - width / 2 / scale, y + height / 2 / scale);
      context.drawImage(this.picture, left, top, width * grown, height * grown);
    }
    context.globalAlpha = 1;
    return late;
  }

  // Bring the picture up to date: all points in another view, unless that was done a moment ago, else the new ones.
  extend(camera, colours) {
    const ratio = devicePixelRatio || 1;
    const view = [camera.x, camera.y, camera.scale, camera.width, camera.height, ratio, this.trails.size].join();
    const redraw = view !== this.view;
    if (redraw && this.view && performance.now() < this.drawnAt + PACE) return false;
    if (redraw) {
      this.view = view;
      this.shown = { x: camera.x, y: camera.y, scale: camera.scale, width: camera.width, height: camera.height };
      this.picture.width = camera.width * ratio;
      this.picture.height = camera.height * ratio;
    }
    const context = this.picture.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const [ns, trail] of this.trails) {
      if (redraw || trail.added) stroke(context, camera, trail, redraw ? 0 : Math.max(0, trail.length - 2 * (trail.added + 1)), colours(ns));
      trail.added = 0;
    }
    if (redraw) this.drawnAt = performance.now();
    return true;
  }
}

function stroke(context, { x, y, scale, width, height }, trail, from, paint) {
  if (!paint) return;
  context.strokeStyle = paint;
  context.lineWidth = 2;
  context.beginPath();
  for (let i = from; i < trail.length; i += 2) context.lineTo(width / 2 + (trail[i] - x) * scale, height / 2 - (trail[i + 1] - y) * scale);
  context.stroke();
}

// Leave out every second point of the older half of a trail.
function thin(trail) {
  const half = trail.length >> 2;
  let kept = 0;
  for (let i = 0; i < half; i += 2, kept++) {
    trail[2 * kept] = trail[2 * i];
    trail[2 * kept + 1] = trail[2 * i + 1];
  }
  trail.splice(2 * kept, 2 * (half - kept));
}
