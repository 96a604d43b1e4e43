// The map from above: grid, world, trails, plans, robots where they are and where odometry has them, and the goal that is being set.

import { Camera } from "./camera.js";
import { el, robotName } from "./dom.js";
import { drawGrid } from "./map_grid.js";
import { MarkerLayer } from "./map_markers.js";
import { TrailLayer } from "./map_trails.js";
import { drawTurtle } from "./map_turtle.js";
import { WorldLayer } from "./map_world.js";
import { colour, onTheme } from "./theme.js";

const FEW = 8; // robots of which every plan is drawn; of more, that of the selected robot, and where the others drive
const LETTER = 6.6; // px, mean width of a letter of a name
const SETTLE = 2000; // ms in which the first look may still widen
const WIDE = 20; // m around the first robot in which markers belong to the first look
const AROUND = 6; // m around robots and plans in which bodies of the world belong to the first look

export class GroundMap {
  // `actions` are what a pointer can cause: {select(ns), goal(x, y, yaw) or null when clicks send none}.
  constructor(actions) {
    this.actions = actions;
    this.camera = new Camera();
    this.world = new WorldLayer();
    this.markers = new MarkerLayer();
    this.robots = [];
    this.byNamespace = new Map();
    this.poses = {};
    this.trails = new TrailLayer();
    this.selected = "";
    this.aim = null;
    this.fitted = this.touched = false;
    this.dirty = true;
    this.pointers = new Map();
    this.canvas = el("canvas", { class: "map", tabIndex: 0, "aria-label": "Map from above" });
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    onTheme(() => { this.colours = null; this.dirty = true; });
    for (const [kind, act] of [["pointerdown", this.down], ["pointermove", this.move], ["pointerup", this.up], ["pointercancel", this.up]]) {
      this.canvas.addEventListener(kind, act.bind(this));
    }
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.touched = true;
      this.camera.zoom(Math.exp(-Math.sign(event.deltaY) * 0.15), event.offsetX, event.offsetY);
      this.dirty = true;
    }, { passive: false });
  }

  setPoses(poses) {
    this.poses = poses;
    this.dirty = true;
    this.trails.add(poses);
    if (!this.fitted) this.fitAtStart();
  }

  setRobots(robots) {
    this.robots = robots;
    this.byNamespace = new Map(robots.map((each) => [each.ns, each]));
    this.trails.keep(this.byNamespace);
    this.dirty = true;
    this.fitAtStart();
  }

  setBodies(bodies) {
    this.world.setBodies(bodies);
    this.dirty = true;
    this.fitAtStart();
  }

  setOutlines(outlines) {
    this.world.setOutlines(outlines);
    this.dirty = true;
  }

  setMarkers(message) {
    this.markers.update(message);
    this.dirty = true;
    this.fitAtStart();
  }

  setScan(scan) {
    this.world.scan = scan;
    this.dirty = true;
  }

  // The first look is at everything: all robots, and plans that arrive a moment later; then nothing moves by itself.
  // What the user did before there was anything to see does not prevent it.
  fitAtStart() {
    const all = this.robots.length > 0 && this.robots.every(({ ns }) => this.poses[ns]);
    if ((this.fitted && this.touched) || !all || !this.canvas.clientWidth) return;
    this.startEnds ??= performance.now() + SETTLE;
    if (performance.now() <= this.startEnds) this.fit();
  }

  clear() { this.trails.clear(); this.dirty = true; }

  fit() {
    this.fitted = true;
    const points = Object.values(this.poses).map(([x, y]) => [x, y]);
    for (const robot of this.robots) points.push(...robot.plan);
    this.camera.fit([...points, ...this.world.cornersNear(points, AROUND), ...near(points, this.markers.corners())]);
    this.dirty = true;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas, ratio = devicePixelRatio || 1;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    this.camera.width = width;
    this.camera.height = height;
    this.fitAtStart();
    this.dirty = true;
    this.draw();
  }

  // Whether the drawing is out of date; if so, it is drawn in the page's next frame.
  get dirty() { return this.changed; }

  set dirty(changed) {
    this.changed = changed;
    if (changed) this.actions.redraw();
  }

  // A turtle draws its trail itself, by its pen.
  isTurtle(ns) { return this.byNamespace.get(ns)?.model === "turtle"; }

  colourOf(ns) { return this.byNamespace.get(ns)?.colour ?? colour("quiet"); }

  draw() {
    if (!this.dirty || !this.canvas.width) return;
    this.dirty = false;
    this.colours ??= Object.fromEntries(["ground", "grid", "axis", "quiet", "text", "bad", "accent"].map((each) => [each, colour(each)]));
    const context = this.canvas.getContext("2d"), ratio = devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.colours.ground;
    context.fillRect(0, 0, this.camera.width, this.camera.height);
    drawGrid(context, this.camera, this.colours);
    this.dirty = this.world.draw(context, this.camera, this.colours);
    this.markers.draw(context, this.camera);
    this.dirty = this.trails.draw(context, this.camera, (ns) => (this.isTurtle(ns) ? null : this.colourOf(ns))) || this.dirty;
    const all = this.robots.length <= FEW;
    for (const robot of this.robots) if (robot.plan.length) (all || robot.ns === this.selected) ? this.drawPlan(context, robot) : this.drawGoal(context, robot);
    this.world.drawScan(context, this.camera, this.selected, this.colourOf(this.selected));
    for (const [ns, pose] of Object.entries(this.poses)) this.drawRobot(context, ns, pose);
    this.drawNames(context);
    if (this.aim) this.drawAim(context);
  }

  drawPlan(context, robot) {
    const points = robot.plan.map(([x, y]) => this.camera.toScreen(x, y)), pose = this.poses[robot.ns];
    context.strokeStyle = context.fillStyle = this.colourOf(robot.ns);
    context.globalAlpha = robot.ns === this.selected ? 0.9 : 0.45;
    context.lineWidth = 1;
    context.setLineDash([3, 4]);
    context.beginPath();
    for (const point of points) context.lineTo(...point);
    if (pose && robot.state === "driving" && points[robot.index]) {
      context.moveTo(...this.camera.toScreen(pose[0], pose[1]));
      context.lineTo(...points[robot.index]);
    }
    context.stroke();
    context.setLineDash([]);
    points.forEach(([px, py], index) => {
      context.beginPath();
      if (index === robot.index && robot.state === "driving") {
        context.arc(px, py, 6, 0, 2 * Math.PI);
        context.stroke();
      }
      context.moveTo(px + 3, py);
      context.arc(px, py, index === robot.index ? 3 : 2, 0, 2 * Math.PI);
      context.fill();
    });
    context.globalAlpha = 1;
  }

  drawRobot(context, ns, [x, y, yaw, ex, ey, eyaw]) {
    const robot = this.byNamespace.get(ns), paint = this.colourOf(ns);
    const size = Math.max(9, (robot?.radius || 0.13) * this.camera.scale);
    const apart = Math.hypot(ex - x, ey - y) * this.camera.scale > 3 || Math.abs(Math.atan2(Math.sin(eyaw - yaw), Math.cos(eyaw - yaw))) > 0.1;
    if (apart) {
      this.outline(context, ex, ey, eyaw, size);
      context.strokeStyle = paint;
      context.setLineDash([4, 3]);
      context.lineWidth = 1.5;
      context.stroke();
      context.setLineDash([]);
    }
    const [px, py] = this.camera.toScreen(x, y);
    if (robot?.model === "turtle") drawTurtle(context, px, py, yaw, size, paint);
    else if (robot && !robot.drives) {
      context.beginPath();
      context.rect(px - size * 0.8, py - size * 0.8, size * 1.6, size * 1.6);
    } else this.outline(context, x, y, yaw, size);
    if (robot?.model !== "turtle") {
      context.fillStyle = paint;
      context.fill();
    }
    if (robot?.stopped || robot?.colliding || ns === this.selected) {
      context.strokeStyle = robot?.stopped || robot?.colliding ? this.colours.bad : this.colours.text;
      context.lineWidth = 2;
      context.beginPath();
      context.arc(px, py, size + 6, 0, 2 * Math.PI);
      context.stroke();
    }
  }

  // The names, as far as they have room: that of the selected robot first, then of those that need a look.
  drawNames(context) {
    const { width, height } = this.camera, rows = new Map(), first = [], rest = [];
    for (const ns of Object.keys(this.poses)) {
      const robot = this.byNamespace.get(ns);
      if (ns === this.selected) first.unshift(ns);
      else (robot?.stopped || robot?.colliding ? first : rest).push(ns);
    }
    context.fillStyle = this.colours.text;
    context.font = "12px system-ui, sans-serif";
    this.named = 0;
    for (const ns of [...first, ...rest]) {
      const size = Math.max(9, (this.byNamespace.get(ns)?.radius || 0.13) * this.camera.scale), name = robotName(ns);
      const [px, py] = this.camera.toScreen(this.poses[ns][0], this.poses[ns][1]);
      const x = px + size + 6, y = py - size * 0.6, end = x + LETTER * name.length + 4;
      if (end < 0 || x > width || y < 0 || y > height + 12) continue;
      const row = Math.floor(y / 14);
      if ([row - 1, row, row + 1].some((at) => rows.get(at)?.some(([a, b, base]) => a < end && b > x && Math.abs(base - y) < 13))) continue;
      if (!rows.has(row)) rows.set(row, []);
      rows.get(row).push([x, end, y]);
      context.fillText(name, x, y);
      this.named++;
    }
  }

  // Where a robot of many drives.
  drawGoal(context, robot) {
    const goal = robot.state === "driving" && robot.plan[robot.index];
    if (!goal) return;
    const [px, py] = this.camera.toScreen(goal[0], goal[1]);
    context.strokeStyle = robot.colour;
    context.lineWidth = 1;
    context.strokeRect(px - 2.5, py - 2.5, 5, 5);
  }

  // A drop that points where the robot looks.
  outline(context, x, y, yaw, size) {
    const [px, py] = this.camera.toScreen(x, y);
    context.beginPath();
    context.arc(px, py, size, -yaw + 0.6, -yaw - 0.6 + 2 * Math.PI);
    context.lineTo(px + 1.5 * size * Math.cos(yaw), py - 1.5 * size * Math.sin(yaw));
    context.closePath();
  }

  drawAim(context) {
    const [px, py] = this.camera.toScreen(this.aim.x, this.aim.y), { yaw } = this.aim;
    context.strokeStyle = context.fillStyle = this.colours.accent;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(px, py, 7, 0, 2 * Math.PI);
    context.moveTo(px, py);
    context.lineTo(px + 34 * Math.cos(yaw), py - 34 * Math.sin(yaw));
    context.stroke();
  }

  down(event) {
    if (event.button > 0) return;
    this.touched = true;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.moved = 0;
    if (this.pointers.size > 1) { this.aim = null; return; }
    if (this.actions.aims()) {
      const [x, y] = this.camera.toWorld(event.offsetX, event.offsetY);
      this.aim = { x, y, yaw: this.towards(x, y), px: event.offsetX, py: event.offsetY };
      this.dirty = true;
    }
  }

  // Without a drag, a goal looks the way that the robot has to go.
  towards(x, y) {
    const pose = this.poses[this.selected];
    return pose ? Math.atan2(y - pose[1], x - pose[0]) : 0;
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY], dx = now[0] - before[0], dy = now[1] - before[1];
    this.moved += Math.hypot(dx, dy);
    if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const far = Math.hypot(now[0] - other[0], now[1] - other[1]), was = Math.hypot(before[0] - other[0], before[1] - other[1]);
      if (was > 0) this.camera.zoom(far / was, (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      this.camera.pan(dx / 2, dy / 2);
    } else if (this.aim) {
      const ax = now[0] - this.aim.px, ay = now[1] - this.aim.py;
      if (Math.hypot(ax, ay) > 12) this.aim.yaw = Math.atan2(-ay, ax);
    } else {
      this.camera.pan(dx, dy);
    }
    this.pointers.set(event.pointerId, now);
    this.dirty = true;
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    const aim = this.aim;
    this.aim = null;
    this.dirty = true;
    if (event.type === "pointercancel" || this.pointers.size) return;
    if (aim) this.actions.goal(aim.x, aim.y, aim.yaw);
    else if (this.moved < 5) this.pick(event.offsetX, event.offsetY);
  }

  pick(px, py) {
    const near = Object.entries(this.poses)
      .map(([ns, [x, y]]) => { const [sx, sy] = this.camera.toScreen(x, y); return [Math.hypot(sx - px, sy - py), ns]; })
      .sort((a, b) => a[0] - b[0])[0];
    if (near && near[0] < 30) this.actions.select(near[1]);
  }
}

// Of some corners those that lie within WIDE metres of the first point, so that no far mark takes the look away.
function near(points, corners) {
  const [x, y] = points[0] ?? [0, 0];
  return corners.filter(([cx, cy]) => Math.abs(cx - x) < WIDE && Math.abs(cy - y) < WIDE);
}
