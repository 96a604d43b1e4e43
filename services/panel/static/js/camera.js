// Where one looks at the ground from above: metres to pixels and back, moved by pointer, wheel and two fingers.

export class Camera {
  constructor() {
    this.x = 0; this.y = 0; // m, in the middle of the picture
    this.scale = 60; // pixels per metre
    this.width = 1; this.height = 1;
  }

  toScreen(x, y) { return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale]; }
  toWorld(px, py) { return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale]; }

  pan(dx, dy) { this.x -= dx / this.scale; this.y += dy / this.scale; }

  zoom(factor, px, py) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(2000, Math.max(4, this.scale * factor));
    const [nx, ny] = this.toWorld(px, py);
    this.x += x - nx;
    this.y += y - ny;
  }

  // Show all these points, with room around them.
  fit(points, least = 4) {
    if (!points.length) return;
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const point of points) {
      for (const axis of [0, 1]) {
        low[axis] = Math.min(low[axis], point[axis]);
        high[axis] = Math.max(high[axis], point[axis]);
      }
    }
    this.x = (low[0] + high[0]) / 2;
    this.y = (low[1] + high[1]) / 2;
    const wide = Math.max(least, high[0] - low[0] + 1), tall = Math.max(least, high[1] - low[1] + 1);
    this.scale = Math.min(2000, Math.max(4, Math.min(this.width / wide, this.height / tall)));
  }
}
