// A small line over the last half hour, from a floor of 0 to a round number on top.

const GUTTER = 52; // pixels for the numbers

export class Plot {
  constructor(canvas, format, top) {
    this.canvas = canvas;
    this.format = format;
    this.top = top; // a fixed top, or undefined for one that fits
    this.samples = []; // [stamp, value]
  }

  set(stamps, values) {
    this.samples = stamps.map((stamp, i) => [stamp, values[i]]).filter(([, value]) => value !== null);
  }

  add(stamp, value) {
    const last = this.samples.at(-1);
    if (last !== undefined && stamp < last[0]) this.samples = [];
    if (value === null || (last !== undefined && stamp >= last[0] && stamp < last[0] + 1)) return;
    this.samples.push([stamp, value]);
    while (this.samples[0][0] < stamp - 1800) this.samples.shift();
  }

  // So many seconds from a stamp on, which plots above each other have in common.
  draw(styles, first, span) {
    const { canvas } = this, ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    const top = this.top ?? rounded(Math.max(...this.samples.map(([, value]) => value), 0));
    c.font = "11px system-ui, sans-serif";
    c.fillStyle = c.strokeStyle = styles.getPropertyValue("--faint");
    c.lineWidth = 1;
    c.globalAlpha = 0.45;
    c.strokeRect(GUTTER + 0.5, 0.5, width - GUTTER - 1, height - 1);
    c.globalAlpha = 1;
    if (this.samples.length < 2) { c.fillText("nothing yet", GUTTER + 8, height / 2 + 4); return; }
    c.beginPath();
    for (const [stamp, value] of this.samples) {
      c.lineTo(GUTTER + 2 + ((stamp - first) / span) * (width - GUTTER - 4), height - 2 - (Math.min(value, top) / top) * (height - 4));
    }
    c.strokeStyle = styles.getPropertyValue("--edge");
    c.lineWidth = 2;
    c.lineJoin = "round";
    c.stroke();
    c.textAlign = "right";
    c.fillText(this.format(top), GUTTER - 6, 10);
    c.fillText("0", GUTTER - 6, height - 2);
  }
}

// What several plots show: the first stamp, and the seconds from there, a minute at least.
export function extent(plots) {
  const ends = plots.filter((plot) => plot.samples.length).flatMap((plot) => [plot.samples[0][0], plot.samples.at(-1)[0]]);
  const first = Math.min(...ends);
  return [first, Math.max(60, ...ends.map((stamp) => stamp - first))];
}

// 1, 2 or 5 times a power of ten, not below the value.
function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-3)));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}
