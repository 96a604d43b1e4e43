// The world below the robots: bodies that stand, drawn once for each view of the map, those that move, and laser echoes.

const FILL = 0.5, GROUND_FILL = 0.18; // opacity of a body, and of what robots drive on
const ECHO = 2.5; // pixels
const ALL = 30; // m; a world of this size is shown whole at first

export class WorldLayer {
  constructor() {
    this.fixed = [];
    this.moving = new Map(); // name -> {colour, path, outlines}
    this.scan = null; // {ns, points}
    this.view = ""; // what the copy shows
    this.copy = document.createElement("canvas");
  }

  setBodies(bodies) {
    this.bodies = bodies;
    this.fixed = bodies.filter(({ kind }) => kind === "fixed" || kind === "ground").map(pathOf);
    this.moving = new Map(bodies.filter(({ kind }) => kind !== "fixed" && kind !== "ground").map((body) => [body.name, pathOf(body)]));
    this.view = "";
  }

  setOutlines(outlines) {
    for (const [name, each] of Object.entries(outlines)) {
      const body = this.moving.get(name);
      if (body) this.moving.set(name, pathOf({ ...body, outlines: each }));
    }
  }

  // The corners of all bodies, in a world larger than ALL those within `margin` metres of some points alone.
  cornersNear(points, margin) {
    if (!points.length) return [];
    const corners = [];
    for (const { outlines } of [...this.fixed, ...this.moving.values()]) {
      for (const outline of outlines) for (let i = 0; i < outline.length; i += 2) corners.push([outline[i], outline[i + 1]]);
    }
    const [left, right, bottom, top] = boundsOf([...points, ...corners]);
    if (right - left <= ALL && top - bottom <= ALL) return corners;
    const near = boundsOf(points);
    return corners.filter(([x, y]) => x > near[0] - margin && x < near[1] + margin && y > near[2] - margin && y < near[3] + margin);
  }

  draw(context, camera, colours) {
    const ratio = devicePixelRatio || 1;
    const view = [camera.x, camera.y, camera.scale, camera.width, camera.height, ratio, colours.ground].join();
    if (this.fixed.length && view !== this.view) {
      this.view = view;
      this.copy.width = camera.width * ratio;
      this.copy.height = camera.height * ratio;
      const copied = this.copy.getContext("2d");
      for (const body of this.fixed) drawBody(copied, camera, ratio, body, colours.quiet);
    }
    if (this.fixed.length) context.drawImage(this.copy, 0, 0, camera.width, camera.height);
    context.save();
    for (const body of this.moving.values()) drawBody(context, camera, ratio, body, colours.text);
    context.restore();
  }

  drawScan(context, camera, ns, paint) {
    if (this.scan?.ns !== ns) return;
    const { points } = this.scan;
    context.fillStyle = paint;
    for (let i = 0; i < points.length; i += 2) {
      const [px, py] = camera.toScreen(points[i], points[i + 1]);
      context.fillRect(px - ECHO / 2, py - ECHO / 2, ECHO, ECHO);
    }
  }
}

function boundsOf(points) {
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of points) {
    left = Math.min(left, x); right = Math.max(right, x);
    bottom = Math.min(bottom, y); top = Math.max(top, y);
  }
  return [left, right, bottom, top];
}

// A body with its outlines as one path in metres; a mesh has many outlines, whose inner edges are not drawn.
function pathOf({ name, kind, colour, outlines }) {
  const path = new Path2D();
  for (const outline of outlines) {
    path.moveTo(outline[0], outline[1]);
    for (let i = 2; i < outline.length; i += 2) path.lineTo(outline[i], outline[i + 1]);
    path.closePath();
  }
  return { name, kind, colour, outlines, path };
}

function drawBody(context, camera, ratio, { kind, colour, outlines, path }, edge) {
  const scale = ratio * camera.scale;
  context.setTransform(scale, 0, 0, -scale, ratio * camera.width / 2 - scale * camera.x, ratio * camera.height / 2 + scale * camera.y);
  context.globalAlpha = kind === "ground" ? GROUND_FILL : FILL;
  context.fillStyle = colour;
  context.fill(path);
  context.globalAlpha = kind === "ground" ? 0.5 : 1;
  context.lineWidth = (outlines.length > 1 ? 0.75 : 1.25) / camera.scale;
  context.strokeStyle = outlines.length > 1 ? colour : edge;
  context.stroke(path);
  context.globalAlpha = 1;
}
