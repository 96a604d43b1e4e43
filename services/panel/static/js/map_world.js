// The world below the robots: bodies that stand, drawn once for each view of the map, those that move, and laser echoes.

const FILL = 0.5, GROUND_FILL = 0.18; // opacity of a body, and of what robots drive on
const EDGE = 1.25, ECHO = 2.5; // pixels
const PACE = 150; // ms between two drawings of what stands while the view moves
const ALL = 30; // m; a world of this size is shown whole at first

export class WorldLayer {
  constructor() {
    this.fixed = [];
    this.moving = new Map(); // name -> {colour, path, outlines}
    this.scan = null; // {ns, points}
    this.view = ""; // what the copy shows
    this.copy = document.createElement("canvas");
    this.layer = document.createElement("canvas"); // one body of many parts
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

  // Draws the bodies; whether the picture is to be drawn again soon, as it was only moved along with the view.
  draw(context, camera, colours) {
    const ratio = devicePixelRatio || 1, late = this.fixed.length > 0 && !this.copyFor(camera, colours, ratio);
    if (this.fixed.length) {
      const { x, y, scale, width, height } = this.shown, grown = camera.scale / scale;
      const [left, top] = camera.toScreen(x - width / 2 / scale, y + height / 2 / scale);
      context.drawImage(this.copy, left, top, width * grown, height * grown);
    }
    context.save();
    for (const body of this.moving.values()) drawBody(context, camera, ratio, body, colours.text);
    context.restore();
    return late;
  }

  // Draw what stands for the view of the camera, unless that was done a moment ago; whether the copy is that of the view.
  copyFor(camera, colours, ratio) {
    const view = [camera.x, camera.y, camera.scale, camera.width, camera.height, ratio, colours.ground].join();
    if (view === this.view) return true;
    if (this.view && performance.now() < this.drawnAt + PACE) return false;
    this.view = view;
    this.shown = { x: camera.x, y: camera.y, scale: camera.scale, width: camera.width, height: camera.height };
    this.copy.width = this.layer.width = camera.width * ratio;
    this.copy.height = this.layer.height = camera.height * ratio;
    const copied = this.copy.getContext("2d");
    for (const body of this.fixed) {
      if (body.outlines.length > 1) this.drawParts(copied, camera, ratio, body, colours.quiet);
      else drawBody(copied, camera, ratio, body, colours.quiet);
    }
    this.drawnAt = performance.now();
    return true;
  }

  // A body of many parts, as a mesh or a floor plan: the edge of all of them together, none between two.
  drawParts(context, camera, ratio, { kind, colour, path }, edge) {
    const layer = this.layer.getContext("2d");
    layer.setTransform(1, 0, 0, 1, 0, 0);
    layer.clearRect(0, 0, this.layer.width, this.layer.height);
    lookThrough(layer, camera, ratio);
    layer.lineWidth = 2 * EDGE / camera.scale;
    layer.strokeStyle = edge;
    layer.stroke(path);
    layer.globalCompositeOperation = "destination-out";
    layer.fill(path);
    layer.globalCompositeOperation = "source-over";
    layer.globalAlpha = kind === "ground" ? GROUND_FILL : FILL;
    layer.fillStyle = colour;
    layer.fill(path);
    layer.globalAlpha = 1;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.layer, 0, 0);
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

// A body with its outlines as one path in metres.
function pathOf({ name, kind, colour, outlines }) {
  const path = new Path2D();
  for (const outline of outlines) {
    path.moveTo(outline[0], outline[1]);
    for (let i = 2; i < outline.length; i += 2) path.lineTo(outline[i], outline[i + 1]);
    path.closePath();
  }
  return { name, kind, colour, outlines, path };
}

function lookThrough(context, camera, ratio) {
  const scale = ratio * camera.scale;
  context.setTransform(scale, 0, 0, -scale, ratio * camera.width / 2 - scale * camera.x, ratio * camera.height / 2 + scale * camera.y);
}

function drawBody(context, camera, ratio, { kind, colour, path }, edge) {
  lookThrough(context, camera, ratio);
  context.globalAlpha = kind === "ground" ? GROUND_FILL : FILL;
  context.fillStyle = colour;
  context.fill(path);
  context.globalAlpha = kind === "ground" ? 0.5 : 1;
  context.lineWidth = EDGE / camera.scale;
  context.strokeStyle = edge;
  context.stroke(path);
  context.globalAlpha = 1;
}
