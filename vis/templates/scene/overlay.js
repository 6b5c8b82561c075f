// What lies over the picture: arrows of forces, the undisturbed surface, a scale bar, axes, the colour scale.

const INK = "#222222", FORCE = "#B00020", RIM = "#ffffff", HALO = "rgba(255, 255, 255, 0.75)";
const ARROW = 0.22; // Length of the arrow of the reference force, over the picture's height.

/** The largest 1, 2 or 5 times a power of ten not above a number. */
function niceBelow(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  return [5, 2, 1].map((n) => n * power).find((n) => n <= 1.0001 * number) || power;
}

/** A number with three digits and a unit whose prefix fits: 0.0034 N is 3.4 mN. */
function withUnit(value, unit) {
  const size = Math.abs(value);
  const [factor, prefix] = [[1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]].find(([f]) => size >= f) || [1, ""];
  return `${+(value / factor).toPrecision(3)} ${prefix}${unit}`;
}

/** A length in mm, or in m from 1 m on. */
function length(metres) {
  return metres < 1 ? `${+(1e3 * metres).toPrecision(3)} mm` : `${+metres.toPrecision(3)} m`;
}

class Overlay {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
  }

  /** Begin a picture of a size [CSS pixels] through a view; points are placed on it by `place`. */
  begin(view, width, height, ratio) {
    Object.assign(this, { view, width, height });
    Object.assign(this.canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.font = "12px system-ui, 'DejaVu Sans', Arial, sans-serif";
    this.pen.lineCap = "butt";
  }

  place(point) {
    const away = point.map((p, k) => p - this.view.centre[k]), scale = this.height / this.view.tall;
    const along = (axis) => axis[0] * away[0] + axis[1] * away[1] + axis[2] * away[2];
    return [this.width / 2 + scale * along(this.view.right), this.height / 2 - scale * along(this.view.up)];
  }

  line(points, colour, thick, dash = []) {
    const pen = this.pen;
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.setLineDash(dash);
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
    pen.setLineDash([]);
  }

  words(text, x, y, align = "left", colour = INK) {
    const pen = this.pen, wide = pen.measureText(text).width;
    const left = align === "left" ? x : align === "right" ? x - wide : x - wide / 2;
    pen.fillStyle = HALO;
    pen.fillRect(left - 3, y - 9, wide + 6, 18);
    pen.fillStyle = colour;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(text, left, y);
  }

  arrow(from, to, newton) {
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]], long = Math.hypot(dx, dy);
    if (long < 4) return;
    const inside = Math.min(1, this.roomAlong(from, dx, dy)), end = [from[0] + inside * dx, from[1] + inside * dy];
    if (inside <= 0) return;
    const head = Math.min(11, 0.5 * long * inside), [ux, uy] = [dx / long, dy / long];
    const shaft = [from, [end[0] - 0.8 * head * ux, end[1] - 0.8 * head * uy]], pen = this.pen;
    const tip = new Path2D();
    tip.moveTo(...end);
    tip.lineTo(end[0] - head * ux - 0.45 * head * uy, end[1] - head * uy + 0.45 * head * ux);
    tip.lineTo(end[0] - head * ux + 0.45 * head * uy, end[1] - head * uy - 0.45 * head * ux);
    tip.closePath();
    this.line(shaft, RIM, 6); // A white rim: dark grains and metal hide a dark arrow.
    Object.assign(pen, { strokeStyle: RIM, lineWidth: 3, lineJoin: "round" });
    pen.stroke(tip);
    this.line(shaft, FORCE, 3);
    pen.fillStyle = FORCE;
    pen.fill(tip);
    if (newton !== null) {
      const text = withUnit(newton, "N") + (inside < 1 ? ", arrow cut" : "");
      const left = end[0] < 0.6 * this.width;
      this.words(text, end[0] + (left ? 12 : -12), Math.max(40, end[1] + 4), left ? "left" : "right", FORCE);
    }
  }

  /** Which share of an arrow lies inside the picture. */
  roomAlong([x, y], dx, dy) {
    const margin = 6;
    const along = (at, d, high) => (d > 0 ? (high - margin - at) / d : d < 0 ? (margin - at) / d : Infinity);
    return Math.min(along(x, dx, this.width), along(y, dy, this.height));
  }

  /** Forces of a frame; `reference` has the name and the amount of the force that `ARROW` belongs to. */
  forces(arrows, reference) {
    if (!reference) return;
    const metres = (ARROW * this.view.tall) / reference.newton;
    for (const [x, y, z, fx, fy, fz] of arrows)
      this.arrow(this.place([x, y, z]), this.place([x + metres * fx, y + metres * fy, z + metres * fz]), Math.hypot(fx, fy, fz));
    const long = ARROW * this.height, left = 14, y = this.height - 62;
    this.arrow([left, y], [left + long, y], null);
    this.words(`${reference.name}, ${withUnit(reference.newton, "N")}`, left, y - 14);
  }

  surface(low, high, cut, level) {
    const front = Math.max(low[1], Math.min(high[1], cut));
    const ends = [[low[0], front, level], [high[0], front, level]].map((point) => this.place(point));
    this.line(ends, INK, 1, [5, 4]);
    const right = ends[0][0] > ends[1][0] ? ends[0] : ends[1];
    const outside = right[0] + 140 < this.width;
    this.words("undisturbed surface", right[0] + (outside ? 8 : -8), right[1] - (outside ? 0 : 12), outside ? "left" : "right");
  }

  scaleBar() {
    const metres = niceBelow((0.22 * this.view.tall * this.width) / this.height);
    const long = (metres * this.height) / this.view.tall, y = this.height - 22, x = 14;
    this.line([[x, y], [x + long, y]], INK, 3);
    for (const end of [x, x + long]) this.line([[end, y - 5], [end, y + 5]], INK, 1.5);
    this.words(length(metres), x + long / 2, y - 13, "middle");
  }

  axes() {
    const x = this.width - 44, y = this.height - 40, long = 26, { right, up } = this.view;
    ["x", "y", "z"].forEach((name, k) => {
      const end = [x + long * right[k], y - long * up[k]];
      this.line([[x, y], end], INK, 1.5);
      this.words(name, x + 1.35 * long * right[k], y - 1.35 * long * up[k], "middle");
    });
  }

  colourScale(palette, { label, top }) {
    const pen = this.pen, long = Math.min(220, 0.5 * this.height), x = this.width - 30, y = 46;
    for (let k = 0; k < long; k++) {
      const ink = palette[Math.round((255 * (long - 1 - k)) / (long - 1))];
      pen.fillStyle = `rgb(${ink & 255}, ${(ink >> 8) & 255}, ${(ink >> 16) & 255})`;
      pen.fillRect(x, y + k, 14, 1.5);
    }
    this.words(label, this.width - 10, y - 20, "right");
    for (const share of [0, 0.5, 1]) {
      const text = (share === 1 ? "≥ " : "") + +(share * top).toPrecision(3);
      this.words(text, x - 6, y + (1 - share) * long, "right");
    }
  }
}
