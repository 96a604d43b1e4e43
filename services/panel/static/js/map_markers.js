// What nodes publish to be drawn, between the world and the robots: areas, lines and texts in metres.

const THIN = 1; // pixels that a line has at least

export class MarkerLayer {
  constructor() { this.shapes = new Map(); }

  // The shapes of a message of the panel: all of them, or those that have changed and the ids of those that are gone.
  update({ first, shapes, gone }) {
    if (first) this.shapes.clear();
    for (const id of gone) this.shapes.delete(id);
    for (const shape of shapes) {
      this.shapes.delete(shape.id); // drawn over all that came before
      this.shapes.set(shape.id, { ...shape, path: pathOf(shape) });
    }
    if (shapes.some(({ kind }) => kind === "area")) this.sort();
  }

  // Areas lie below lines, and texts above all; else the newest is on top.
  sort() {
    const level = { area: 0, line: 1, text: 2 };
    this.shapes = new Map([...this.shapes].sort(([, a], [, b]) => level[a.kind] - level[b.kind]));
  }

  // The corners of all areas, as points.
  corners() {
    const found = [];
    for (const { kind, outlines } of this.shapes.values()) {
      if (kind !== "area") continue;
      for (const outline of outlines) for (let i = 0; i < outline.length; i += 2) found.push([outline[i], outline[i + 1]]);
    }
    return found;
  }

  draw(context, camera) {
    const ratio = devicePixelRatio || 1, scale = ratio * camera.scale;
    context.save();
    for (const { kind, colour, width, text, outlines, path } of this.shapes.values()) {
      context.setTransform(scale, 0, 0, -scale, ratio * camera.width / 2 - scale * camera.x, ratio * camera.height / 2 + scale * camera.y);
      context.fillStyle = context.strokeStyle = colour;
      if (kind === "area") context.fill(path);
      else if (kind === "line") {
        context.lineWidth = Math.max(width, THIN / camera.scale);
        context.lineJoin = context.lineCap = "round";
        context.stroke(path);
      } else {
        const [px, py] = camera.toScreen(...outlines[0]);
        context.setTransform(ratio, 0, 0, ratio, 0, 0);
        context.font = `${Math.max(9, width * camera.scale)}px system-ui, sans-serif`;
        context.textAlign = "center";
        context.textBaseline = "middle";
        context.fillText(text, px, py);
      }
    }
    context.restore();
  }
}

function pathOf({ kind, outlines }) {
  const path = new Path2D();
  for (const outline of outlines) {
    path.moveTo(outline[0], outline[1]);
    for (let i = 2; i < outline.length; i += 2) path.lineTo(outline[i], outline[i + 1]);
    if (kind === "area") path.closePath();
  }
  return path;
}
