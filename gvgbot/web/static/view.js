// Which part of the map is shown, and the gestures that change it.

const LEAST = 4, MOST = 400; // pixels per metre
const MARGIN = 16, BUTTONS = 66; // pixels around the map, and below it
const TAP = 6; // pixels that a finger may move and still have tapped

export class View {
  constructor(canvas, onChange, onMove, onTap) {
    this.canvas = canvas;
    this.onChange = onChange;
    this.onMove = onMove; // by hand, elsewhere
    this.onTap = onTap;
    this.x = 0; // m, the point in the middle
    this.y = 0;
    this.scale = 40; // pixels per metre
    this.least = LEAST; // or less, where all is so large
    this.isAutomatic = true; // shows all until somebody moves it
    this.fingers = new Map();
    this.listen();
  }

  get width() { return this.canvas.clientWidth; }
  get height() { return this.canvas.clientHeight; }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toMap(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  fit(box) {
    const [left, bottom, right, top] = box;
    const wide = (this.width - 2 * MARGIN) / Math.max(right - left, 4);
    const below = Math.min(BUTTONS, (this.height - MARGIN) / 2); // in a low window it lies under the buttons
    const high = (this.height - MARGIN - below) / Math.max(top - bottom, 4);
    this.scale = clamp(Math.min(wide, high), 0);
    this.least = Math.min(LEAST, this.scale);
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2 - (below - MARGIN) / 2 / this.scale;
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toMap(px, py);
    this.scale = clamp(this.scale * factor, this.least);
    const [nowX, nowY] = this.toMap(px, py);
    this.shift(x - nowX, y - nowY);
  }

  move(dx, dy) {
    this.shift(dx, dy);
    this.onMove();
  }

  shift(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.isAutomatic = false;
    this.onChange();
  }

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
      this.zoom(Math.exp(-0.0015 * pixels * (event.ctrlKey ? 5 : 1)), ...here(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return; // it opens a menu, which may keep the end of it
      canvas.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, here(event));
      this.path = this.fingers.size === 1 ? 0 : Infinity; // two fingers never tap
    });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("pointerup", (event) => {
      if (this.fingers.delete(event.pointerId) && this.path < TAP) this.onTap(...here(event));
    });
    canvas.addEventListener("pointercancel", (event) => this.fingers.delete(event.pointerId));
    canvas.addEventListener("dblclick", (event) => this.zoom(2, ...here(event)));
    canvas.addEventListener("keydown", (event) => this.press(event));
  }

  drag(event) {
    const before = this.fingers.get(event.pointerId);
    if (before === undefined) return;
    const now = here(event);
    this.path += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (this.path < TAP) { this.fingers.set(event.pointerId, now); return; }
    const others = [...this.fingers].filter(([id]) => id !== event.pointerId);
    this.fingers.set(event.pointerId, now);
    if (others.length === 0) {
      this.move((before[0] - now[0]) / this.scale, (now[1] - before[1]) / this.scale);
      return;
    }
    const still = others[0][1];
    const factor = Math.hypot(now[0] - still[0], now[1] - still[1]) / Math.max(1, Math.hypot(before[0] - still[0], before[1] - still[1]));
    this.shift((before[0] - now[0]) / 2 / this.scale, (now[1] - before[1]) / 2 / this.scale);
    this.zoom(factor, (now[0] + still[0]) / 2, (now[1] + still[1]) / 2);
  }

  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return; // the browser's own
    const step = 60 / this.scale;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (event.key in moves) this.move(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.4);
    else if (event.key === "-") this.zoom(1 / 1.4);
    else return;
    event.preventDefault();
  }
}

const here = (event) => [event.offsetX, event.offsetY];
const clamp = (scale, least) => Math.min(MOST, Math.max(least, scale));
