// The grid of the map, in steps of metres that leave room for their numbers.

const HEADROOM = 60; // pixels at the top, where buttons lie over the map

export function drawGrid(context, camera, colours) {
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((each) => each * camera.scale > 45) ?? 100;
  const [left, top] = camera.toWorld(0, 0), [right, bottom] = camera.toWorld(camera.width, camera.height);
  context.lineWidth = 1;
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colours.quiet;
  const line = (axis, x0, y0, x1, y1) => {
    context.strokeStyle = axis ? colours.axis : colours.grid;
    context.beginPath(); context.moveTo(x0, y0); context.lineTo(x1, y1); context.stroke();
  };
  for (let i = Math.ceil(left / step); i * step <= right; i++) {
    const px = Math.round(camera.toScreen(i * step, 0)[0]) + 0.5;
    line(i === 0, px, 0, px, camera.height);
    context.fillText(Number((i * step).toFixed(2)), px + 3, camera.height - 5);
  }
  for (let i = Math.ceil(bottom / step); i * step <= top; i++) {
    const py = Math.round(camera.toScreen(0, i * step)[1]) + 0.5;
    line(i === 0, 0, py, camera.width, py);
    if (py > HEADROOM) context.fillText(`${Number((i * step).toFixed(2))} m`, 4, py - 3);
  }
}
