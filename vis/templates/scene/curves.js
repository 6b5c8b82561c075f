// Curves over time beside a picture, as SVG, with a cursor at the picture's time. A click on a curve sets the time.

const WIDE = 340, TALL = 132, EDGE = { left: 48, right: 10, top: 20, foot: 20 };

/** The name of SVG's elements, from one: as an address it would look as if the page loaded it. */
const SVG = new DOMParser().parseFromString("<svg></svg>", "text/html").body.firstChild.namespaceURI;

function svg(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Some 3 to 6 round numbers between two. */
function ticks(low, high) {
  const step = [1, 2, 2.5, 5, 10].map((n) => n * 10 ** Math.floor(Math.log10((high - low) / 3 || 1))).filter((n) => (high - low) / n <= 5)[0];
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(+(k * step).toPrecision(10));
  return found;
}

/** The states as every legend lists them. */
const LOSING_HOLD = ["stand", "pivot", "slip", "hop"];

class Curves {
  /** Draws a scene's panels and states into `home`; `choose` is called with a time [s] that was clicked. */
  constructor(home, scene, choose) {
    this.home = home;
    home.replaceChildren();
    this.cursors = [];
    const times = [...scene.times, ...scene.panels.flatMap((panel) => panel.lines.flatMap((line) => line.t))];
    this.low = times.reduce((a, b) => Math.min(a, b), Infinity);
    this.high = times.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(this.high > this.low)) return;
    if (scene.states.length) this.drawStates(scene.states, choose);
    let listed = "";
    scene.panels.forEach((panel, k) => {
      const lines = panel.lines.length > 1 ? panel.lines : [], key = lines.map((line) => `${line.name} ${line.colour}`).join();
      if (key && key !== listed) this.drawLegend(lines), (listed = key);
      this.drawPanel(panel, k === scene.panels.length - 1, choose);
    });
  }

  x(time) {
    return EDGE.left + ((time - this.low) / (this.high - this.low)) * (WIDE - EDGE.left - EDGE.right);
  }

  sheet(tall, label, choose) {
    const sheet = svg("svg", { viewBox: `0 0 ${WIDE} ${tall}`, role: "img", "aria-label": `${label} over time` });
    const pick = (event) => {
      const box = sheet.getBoundingClientRect();
      const share = ((event.clientX - box.left) * (WIDE / box.width) - EDGE.left) / (WIDE - EDGE.left - EDGE.right);
      choose(this.low + Math.max(0, Math.min(1, share)) * (this.high - this.low));
    };
    sheet.addEventListener("pointerdown", (event) => (sheet.setPointerCapture(event.pointerId), pick(event)));
    sheet.addEventListener("pointermove", (event) => event.buttons && pick(event));
    this.home.append(sheet);
    return sheet;
  }

  /** The lines of the panel below it, and of those after it that have the same ones. */
  drawLegend(lines) {
    const names = new Map(lines.map((line) => [line.name, line]));
    const sheet = svg("svg", {});
    let x = EDGE.left, y = 10;
    for (const { name, colour, dashed } of names.values()) {
      const wide = 44 + 6.2 * name.length;
      if (x > EDGE.left && x + wide - 17 > WIDE) [x, y] = [EDGE.left, y + 16];
      sheet.append(svg("line", { x1: x, x2: x + 22, y1: y, y2: y, class: "curve", stroke: colour, "stroke-dasharray": dashed ? "5 3" : "" }));
      sheet.append(svg("text", { x: x + 27, y: y + 4 }, name));
      x += wide;
    }
    sheet.setAttribute("viewBox", `0 0 ${WIDE} ${y + 10}`);
    this.home.append(sheet);
  }

  drawStates(states, choose) {
    const sheet = this.sheet(44, "state", choose), place = (s) => LOSING_HOLD.indexOf(s.state);
    const seen = new Map([...states].sort((a, b) => place(a) - place(b)).map((s) => [s.state, s.colour]));
    let x = EDGE.left;
    for (const [state, colour] of seen) {
      sheet.append(svg("rect", { x, y: 4, width: 10, height: 10, fill: colour }));
      sheet.append(svg("text", { x: x + 14, y: 13 }, state));
      x += 26 + 7 * state.length;
    }
    for (const s of states)
      sheet.append(svg("rect", { x: this.x(s.from), y: 20, width: Math.max(0.5, this.x(s.to) - this.x(s.from)), height: 16, fill: s.colour }));
    this.cursor(sheet, 17, 39);
  }

  drawPanel(panel, last, choose) {
    const tall = TALL + (last ? 14 : 0), sheet = this.sheet(tall, panel.label, choose);
    const values = panel.lines.flatMap((line) => line.y);
    let low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), -Infinity);
    const room = 0.05 * (high - low) || 0.5 * Math.abs(high) || 1;
    [low, high] = [low - room, high + room];
    const share = (value) => (panel.down ? value - low : high - value) / (high - low);
    const y = (value) => EDGE.top + share(value) * (TALL - EDGE.top - EDGE.foot);
    const floor = TALL - EDGE.foot;
    for (const value of ticks(low, high)) {
      sheet.append(svg("line", { x1: EDGE.left, x2: WIDE - EDGE.right, y1: y(value), y2: y(value), class: "grid" }));
      sheet.append(svg("text", { x: EDGE.left - 5, y: y(value) + 3.5, class: "end" }, String(value).replace("-", "−")));
    }
    for (const value of ticks(this.low, this.high)) {
      sheet.append(svg("line", { x1: this.x(value), x2: this.x(value), y1: EDGE.top, y2: floor, class: "grid" }));
      sheet.append(svg("text", { x: this.x(value), y: floor + 13, class: "middle" }, String(value).replace("-", "−")));
    }
    if (last) sheet.append(svg("text", { x: (EDGE.left + WIDE - EDGE.right) / 2, y: TALL + 9, class: "middle" }, "time [s]"));
    for (const line of panel.lines) {
      const points = line.t.map((time, k) => `${this.x(time).toFixed(1)},${y(line.y[k]).toFixed(1)}`).join(" ");
      sheet.append(svg("polyline", { points, stroke: line.colour, class: "curve", "stroke-dasharray": line.dashed ? "5 3" : "" }));
    }
    sheet.append(svg("text", { x: 2, y: 12, class: "label" }, panel.label));
    this.cursor(sheet, EDGE.top, floor, panel.lines, y);
  }

  cursor(sheet, top, foot, lines = [], y = null) {
    const bar = svg("line", { y1: top, y2: foot, class: "cursor" });
    const dots = lines.map((line) => svg("circle", { r: 3.2, fill: line.colour }));
    sheet.append(bar, ...dots);
    this.cursors.push((time) => {
      bar.setAttribute("x1", this.x(time));
      bar.setAttribute("x2", this.x(time));
      lines.forEach((line, k) => {
        const value = valueAt(line, time);
        dots[k].setAttribute("visibility", value === null ? "hidden" : "visible");
        if (value === null) return;
        dots[k].setAttribute("cx", this.x(time));
        dots[k].setAttribute("cy", y(value));
      });
    });
  }

  show(time) {
    for (const cursor of this.cursors) cursor(time);
  }
}

/** A line's value at a time, between its points; null before and after them. */
function valueAt({ t, y }, time) {
  if (time < t[0] || time > t[t.length - 1]) return null;
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  const share = t[high] > t[low] ? (time - t[low]) / (t[high] - t[low]) : 0;
  return y[low] + share * (y[high] - y[low]);
}
