// A turtle from above: shell, head, legs and tail.

const LEGS = [0.75, -0.75, 2.4, -2.4]; // rad from where it looks

// At pixels (px, py), with a shell of the radius `size`, looking along `yaw`.
export function drawTurtle(context, px, py, yaw, size, paint) {
  context.save();
  context.translate(px, py);
  context.rotate(-yaw);
  context.strokeStyle = "rgba(0, 0, 0, .55)";
  context.lineWidth = Math.max(1, size * 0.07);
  context.fillStyle = "#5d8a3c";
  for (const at of LEGS) ellipse(context, 1.0 * size * Math.cos(at), 1.0 * size * Math.sin(at), 0.34 * size, 0.2 * size, at);
  context.beginPath();
  context.moveTo(-0.9 * size, 0.15 * size);
  context.lineTo(-1.4 * size, 0);
  context.lineTo(-0.9 * size, -0.15 * size);
  context.fill();
  ellipse(context, 1.2 * size, 0, 0.36 * size, 0.28 * size, 0);
  context.fillStyle = paint;
  ellipse(context, 0, 0, size, 0.86 * size, 0);
  context.beginPath();
  for (let i = 0; i < 6; i++) {
    const turn = (i * Math.PI) / 3, inner = [0.48 * size * Math.cos(turn), 0.42 * size * Math.sin(turn)];
    context.moveTo(...inner);
    context.lineTo(0.98 * size * Math.cos(turn), 0.85 * size * Math.sin(turn));
    context.moveTo(...inner);
    context.lineTo(0.48 * size * Math.cos(turn + Math.PI / 3), 0.42 * size * Math.sin(turn + Math.PI / 3));
  }
  context.stroke();
  context.fillStyle = "#111";
  for (const side of [-1, 1]) ellipse(context, 1.32 * size, side * 0.13 * size, 0.06 * size, 0.06 * size, 0, false);
  context.restore();
}

function ellipse(context, x, y, rx, ry, turn, edge = true) {
  context.beginPath();
  context.ellipse(x, y, rx, ry, turn, 0, 2 * Math.PI);
  context.fill();
  if (edge) context.stroke();
}
