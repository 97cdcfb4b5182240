// Draws what is known, layer upon layer, in pixels of the screen.

import { Floor } from "./floor.js";
import { millimetres, points, poses } from "./msgpack.js";
import { axes } from "./words.js";

const SIGMAS = 3;
const FRONTIER = 26; // pixels from a vertex to the tip of its frontier's arrow
const FONT = "12px system-ui, sans-serif";
const DISC = 5, NUMBER_HEIGHT = 10, GAP = 2; // pixels, of a vertex, of its number, and between two numbers

export const LAYERS = [
  ["grid", "walls and floor", "wall", "▇"],
  ["trail", "way driven", "trail", "─"],
  ["edges", "edges", "edge", "━"],
  ["ellipses", "3 sigma", "ellipse", "◯"],
  ["vertices", "vertices", "vertex", "●"],
  ["frontiers", "frontiers", "frontier", "➤"],
  ["plan", "plan", "plan", "┅"],
  ["scan", "laser", "scan", "∴"],
];

export class MapPicture {
  constructor(canvas, view) {
    this.canvas = canvas;
    this.view = view;
    this.shown = new Set(LAYERS.map(([name]) => name));
    this.forget();
  }

  // Know nothing, as at first.
  forget() {
    this.known = this.plan = this.scan = this.pose = this.covariance = this.selected = this.tapped = null;
    this.floor = null;
    this.team = [];
    this.trail = []; // lines: x, y and so on
    this.way = []; // [stamp, x, y] since the trail was made
    this.posed = -Infinity; // stamp of the pose
  }

  setColours(styles) {
    this.colours = {};
    for (const name of ["floor", "wall", "trail", "edge", "ellipse", "vertex", "frontier", "plan", "scan", "robot", "paper"]) {
      this.colours[name] = styles.getPropertyValue(`--${name}`).trim();
    }
    this.floor?.setColours(this.colours);
  }

  setMap(known) {
    this.known = known;
    this.edges = known.edges.map((edge) => points(edge.points));
    this.virtualWalls = points(known.virtual_walls ?? new Uint8Array()); // none from an older robot
    this.at = new Map(known.vertices.map((vertex) => [vertex.id, vertex.position]));
  }

  setFloor({ resolution, side }) {
    this.floor = new Floor(resolution, side, this.colours);
  }

  setTrajectory(driven) {
    const xy = Array.from(poses(driven.poses)).filter((_, i) => i % 3 < 2), ends = [...(driven.breaks ?? []), xy.length / 2];
    this.trail = ends.map((end, i) => xy.slice(2 * (ends[i - 1] ?? 0), 2 * end));
    this.way = this.way.filter(([stamp]) => stamp > driven.stamp);
  }

  setScan(scan) {
    this.scan = scan;
    this.dots = scan.map_base === null ? [] : ends(scan);
  }

  setPose(pose, stamp) {
    if (stamp < this.posed) return; // of two topics that tell it, this one came later
    [this.pose, this.posed] = [pose, stamp];
    const last = this.way.at(-1);
    if (last === undefined || Math.hypot(pose[0] - last[1], pose[1] - last[2]) > 0.05) {
      this.way.push([stamp, pose[0], pose[1]]);
      if (this.way.length > 2000) this.way.shift();
    }
  }

  // Left, bottom, right, top, m, of all there is.
  box() {
    const [x, y] = this.pose ?? [0, 0];
    return this.floor?.box ?? [x - 4, y - 4, x + 4, y + 4];
  }

  draw() {
    const { canvas, view } = this, ratio = devicePixelRatio || 1;
    const width = Math.round(view.width * ratio), height = Math.round(view.height * ratio);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const c = (this.c = canvas.getContext("2d"));
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, view.width, view.height);
    c.lineJoin = c.lineCap = "round";
    const layers = {
      grid: () => (this.drawGrid(), this.drawVirtualWalls()), trail: () => this.drawTrail(), edges: () => this.drawEdges(),
      ellipses: () => this.drawEllipses(), frontiers: () => this.drawFrontiers(), vertices: () => this.drawVertices(),
      plan: () => this.drawPlan(), scan: () => this.drawScan(),
    };
    for (const name of ["grid", "trail", "edges", "scan", "ellipses", "frontiers", "vertices", "plan"]) {
      if (this.shown.has(name)) layers[name]();
    }
    this.drawTapped();
    this.drawTeam();
    this.drawRobot();
  }

  drawTapped() {
    if (this.tapped === null) return;
    const [px, py] = this.view.toScreen(...this.tapped), c = this.c;
    for (const [colour, width] of [[this.colours.paper, 5], [this.colours.robot, 2.5]]) {
      c.beginPath();
      for (const [dx, dy] of [[-7, -7], [-7, 7]]) {
        c.moveTo(px + dx, py + dy);
        c.lineTo(px - dx, py - dy);
      }
      c.strokeStyle = colour;
      c.lineWidth = width;
      c.stroke();
    }
  }

  drawGrid() {
    if (!this.floor?.picture) return;
    const { picture, left, top, resolution } = this.floor;
    this.c.imageSmoothingEnabled = this.view.scale * resolution < 3;
    this.c.imageSmoothingQuality = "high";
    this.c.drawImage(picture, ...this.view.toScreen(left, top), picture.width * resolution * this.view.scale, picture.height * resolution * this.view.scale);
  }

  // A dot for each point, or as many as there is room for.
  drawVirtualWalls() {
    if (this.known === null) return;
    const c = this.c, xy = this.virtualWalls;
    c.fillStyle = this.colours.wall;
    for (let i = 0, last = null; i < xy.length; i += 2) {
      const [px, py] = this.view.toScreen(xy[i], xy[i + 1]);
      if (last !== null && Math.hypot(px - last[0], py - last[1]) < 5) continue;
      c.beginPath();
      c.arc(px, py, 1.6, 0, 2 * Math.PI);
      c.fill();
      last = [px, py];
    }
  }

  line(xy, colour, width) {
    if (xy.length < 4) return;
    const c = this.c;
    c.beginPath();
    for (let i = 0; i < xy.length; i += 2) c.lineTo(...this.view.toScreen(xy[i], xy[i + 1]));
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.stroke();
  }

  drawTrail() {
    const way = this.way.flatMap(([, x, y]) => [x, y]), last = this.trail.at(-1) ?? [];
    for (const line of [...this.trail.slice(0, -1), [...last, ...way]]) this.line(line, this.colours.trail, 1.5);
  }

  drawEdges() {
    if (this.known === null) return;
    for (const edge of this.edges) this.line(edge, this.colours.edge, 2.5);
  }

  ellipse(x, y, xx, xy, yy) {
    const [long, direction, short] = axes(xx, xy, yy), c = this.c, scale = SIGMAS * this.view.scale;
    c.beginPath();
    c.ellipse(...this.view.toScreen(x, y), long * scale, short * scale, -direction, 0, 2 * Math.PI);
    c.strokeStyle = this.colours.ellipse;
    c.lineWidth = 1.5;
    c.stroke();
  }

  drawEllipses() {
    for (const { position: [x, y], covariance: [xx, xy, , yy] } of this.known?.vertices ?? []) this.ellipse(x, y, xx, xy, yy);
  }

  drawVertices() {
    const c = this.c;
    for (const vertex of this.known?.vertices ?? []) {
      const [px, py] = this.view.toScreen(...vertex.position);
      c.beginPath();
      c.arc(px, py, DISC, 0, 2 * Math.PI);
      c.fillStyle = vertex.kind === "endpoint" ? this.colours.paper : this.colours.vertex;
      c.fill();
      c.strokeStyle = vertex.kind === "endpoint" ? this.colours.vertex : this.colours.paper;
      c.lineWidth = vertex.kind === "endpoint" ? 2.5 : 1;
      c.stroke();
      if (vertex.id === this.selected) {
        c.beginPath();
        c.arc(px, py, 11, 0, 2 * Math.PI);
        c.strokeStyle = this.colours.robot;
        c.lineWidth = 2;
        c.stroke();
      }
    }
    this.drawNumbers();
  }

  drawNumbers() {
    this.c.font = FONT;
    for (const { id, left, bottom } of apart(this.numbers(), this.discs())) this.write(id, left, bottom, this.colours.vertex);
  }

  // Text that can be read whatever lies under it.
  write(text, left, bottom, colour) {
    const c = this.c;
    c.font = FONT;
    c.textAlign = "left";
    c.lineWidth = 3;
    c.strokeStyle = this.colours.paper;
    c.strokeText(text, left, bottom);
    c.fillStyle = colour;
    c.fillText(text, left, bottom);
  }

  // The boxes around the vertices.
  discs() {
    return (this.known?.vertices ?? []).map(({ position }) => {
      const [px, py] = this.view.toScreen(...position);
      return { left: px - DISC, right: px + DISC, top: py - DISC, bottom: py + DISC };
    });
  }

  // Where the number of each vertex would stand, that of the selected one first.
  numbers() {
    const vertices = [...(this.known?.vertices ?? [])];
    vertices.sort((a, b) => (b.id === this.selected) - (a.id === this.selected));
    return vertices.map((vertex) => {
      const [px, py] = this.view.toScreen(...vertex.position), width = this.c.measureText(vertex.id).width;
      const isTaken = vertex.frontiers.some((bearing) => Math.cos(bearing - 0.7) > 0.3);
      const left = px + (isTaken ? -9 - width : 9), bottom = py - 8;
      return { id: vertex.id, left, bottom, right: left + width, top: bottom - NUMBER_HEIGHT };
    });
  }

  arrow(px, py, bearing, colour, size) {
    const c = this.c;
    c.save();
    c.translate(px, py);
    c.rotate(-bearing);
    c.beginPath();
    c.moveTo(size, 0);
    c.lineTo(size - 11, 6);
    c.lineTo(size - 11, -6);
    c.closePath();
    c.fillStyle = colour;
    c.fill();
    c.strokeStyle = this.colours.paper;
    c.lineWidth = 1;
    c.stroke();
    c.restore();
  }

  drawFrontiers() {
    for (const vertex of this.known?.vertices ?? []) {
      const [px, py] = this.view.toScreen(...vertex.position);
      for (const bearing of vertex.frontiers) this.arrow(px, py, bearing, this.colours.frontier, FRONTIER);
    }
  }

  drawPlan() {
    if (this.plan === null) return;
    this.c.setLineDash([7, 6]);
    this.line(points(this.plan.route), this.colours.plan, 3);
    this.line(points(this.plan.track), this.colours.plan, 3);
    this.c.setLineDash([]);
    const target = this.known === null ? undefined : this.at.get(this.plan.vertex);
    if (target === undefined) return;
    const [px, py] = this.view.toScreen(...target);
    this.arrow(px, py, this.plan.bearing, this.colours.plan, FRONTIER + 4);
    this.c.beginPath();
    this.c.arc(px, py, 10, 0, 2 * Math.PI);
    this.c.strokeStyle = this.colours.plan;
    this.c.lineWidth = 2;
    this.c.stroke();
  }

  drawScan() {
    if (this.scan === null) return;
    this.c.fillStyle = this.colours.scan;
    for (let i = 0; i < this.dots.length; i += 2) {
      const [px, py] = this.view.toScreen(this.dots[i], this.dots[i + 1]);
      this.c.fillRect(px - 1, py - 1, 2.5, 2.5);
    }
  }

  drawTeam() {
    for (const { name, pose } of this.team) {
      this.drawArrow(pose, this.colours.trail);
      const [px, py] = this.view.toScreen(pose[0], pose[1]);
      this.write(name, px + 14, py - 10, this.colours.wall);
    }
  }

  drawRobot() {
    if (this.pose === null) return;
    if (this.covariance !== null && this.shown.has("ellipses")) {
      this.ellipse(this.pose[0], this.pose[1], this.covariance[0], this.covariance[1], this.covariance[4]);
    }
    this.drawArrow(this.pose, this.colours.robot);
  }

  drawArrow(pose, colour) {
    const c = this.c, size = Math.max(10, 0.2 * this.view.scale);
    c.save();
    c.translate(...this.view.toScreen(pose[0], pose[1]));
    c.rotate(-pose[2]);
    c.beginPath();
    c.moveTo(1.35 * size, 0);
    c.lineTo(-0.85 * size, 0.85 * size);
    c.lineTo(-0.45 * size, 0);
    c.lineTo(-0.85 * size, -0.85 * size);
    c.closePath();
    c.fillStyle = colour;
    c.fill();
    c.strokeStyle = this.colours.paper;
    c.lineWidth = 1.5;
    c.stroke();
    c.restore();
  }

  // The vertex nearest to a place on the screen, if it is near.
  vertexAt(px, py) {
    let nearest = null, least = 18;
    for (const vertex of this.known?.vertices ?? []) {
      const [vx, vy] = this.view.toScreen(...vertex.position), away = Math.hypot(vx - px, vy - py);
      if (away < least) [nearest, least] = [vertex, away];
    }
    return nearest;
  }
}

// Those boxes for which there is room beside what is there and those before them.
export function apart(boxes, there) {
  const kept = [], isFar = (a, b) => a.left > b.right + GAP || a.right < b.left - GAP || a.top > b.bottom + GAP || a.bottom < b.top - GAP;
  for (const one of boxes) {
    if ([...there, ...kept].every((other) => isFar(one, other))) kept.push(one);
  }
  return kept;
}

// Where the beams ended, map frame, m: x, y, x, y and so on.
function ends(scan) {
  const [bx, by, heading] = scan.map_base, [lx, ly, turned] = scan.base_laser;
  const x = bx + Math.cos(heading) * lx - Math.sin(heading) * ly, y = by + Math.sin(heading) * lx + Math.cos(heading) * ly;
  const found = [], ranges = millimetres(scan.ranges), first = heading + turned + scan.angle_min;
  for (let i = 0; i < ranges.length; i++) {
    if (ranges[i] === 0 || ranges[i] === 65535) continue;
    const bearing = first + i * scan.angle_increment, range = ranges[i] / 1000;
    found.push(x + range * Math.cos(bearing), y + range * Math.sin(bearing));
  }
  return found;
}
