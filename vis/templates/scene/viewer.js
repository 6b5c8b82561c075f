// A scene that can be turned, zoomed and moved through time: its controls, its keys, its camera.

const FASTEST = 1 / 30, PATIENCE = 0.075, LOWEST = 0.4;
const KEYS = "Space: play or pause. ← →: one frame. Page Up, Page Down: first, last frame. Shift + arrows: turn. + −: zoom. W A S D: move. Home: the first view.";
const FIRST_VIEW = { az: -0.45, el: 0.32, zoom: 1, pan: [0, 0] };

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

class Viewer {
  constructor(root) {
    this.root = root;
    this.page = JSON.parse(root.querySelector("script.head").textContent);
    this.palette = new Uint32Array(this.page.palette.map(([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r));
    this.state = { run: 0, frame: 0, playing: false, colour: "", cut: 0, follow: false, ...structuredClone(FIRST_VIEW) };
    this.ratio = 1;
    this.build();
    this.ready = this.open(this.fromHash());
  }

  build() {
    const c = (this.controls = {
      play: element("button", { type: "button", className: "play", textContent: "Play" }),
      time: element("input", { type: "range", min: 0, step: 1, value: 0, ariaLabel: "frame" }),
      clock: element("output", { className: "clock" }),
      run: element("select", { ariaLabel: "run" }),
      colour: element("select"),
      cut: element("input", { type: "range", min: 0, max: 100, step: 1 }),
      follow: element("input", { type: "checkbox" }),
      reset: element("button", { type: "button", textContent: "First view" }),
    });
    this.canvas = element("canvas", { tabIndex: 0 });
    this.over = element("canvas", { className: "over" });
    this.message = element("p", { className: "message", hidden: true });
    this.stage = element("div", { className: "stage" }, this.canvas, this.over, this.message);
    this.beside = element("div", { className: "curves", tabIndex: 0, ariaLabel: "curves" });
    this.labels = {};
    const labelled = (name, text, control) => (this.labels[name] = element("label", {}, text + " ", control));
    const row = element("div", { className: "row" }, c.play, c.time, c.clock);
    const more = element("div", { className: "row" }, labelled("run", "Run", c.run), labelled("colour", "Colour", c.colour),
      labelled("cut", "Cut", c.cut), labelled("follow", "Follow the body", c.follow), c.reset);
    this.notes = element("p", { className: "notes" });
    this.root.append(element("div", { className: "both" }, this.stage, this.beside), row, more,
      element("p", { className: "notes keys", textContent: KEYS }), this.notes);
    this.page.scenes.forEach((scene, k) => c.run.append(element("option", { value: k, textContent: scene.title })));
    c.play.addEventListener("click", () => this.play(!this.state.playing));
    c.time.addEventListener("input", () => this.go(+c.time.value));
    c.run.addEventListener("change", () => this.open({ run: +c.run.value }));
    c.colour.addEventListener("change", () => this.set({ colour: c.colour.value }));
    c.cut.addEventListener("input", () => this.set({ cut: this.cutAt(+c.cut.value / 100) }));
    c.follow.addEventListener("change", () => this.set({ follow: c.follow.checked }));
    c.reset.addEventListener("click", () => this.set(structuredClone(FIRST_VIEW)));
    this.root.addEventListener("keydown", (event) => this.onKey(event));
    this.listenToPointer();
    try {
      this.picture = new Picture(this.canvas);
      this.overlay = new Overlay(this.over);
      new ResizeObserver(() => this.redraw()).observe(this.stage);
    } catch (error) {
      this.picture = null;
      this.tell(`This browser cannot draw the picture (${error.message}). The curves are complete.`);
    }
  }

  /** Show a run of the page; `wanted` may have further parts of the state. */
  async open(wanted) {
    const run = Math.max(0, Math.min(this.page.scenes.length - 1, wanted.run ?? 0));
    const scene = this.page.scenes[run];
    this.play(false);
    const arrays = scene.arrays ? await this.arraysOf(run) : {};
    Object.assign(this, { scene, arrays });
    const follow = scene.walks;
    const colour = scene.colours.length ? scene.colours[0].name : "";
    this.state = { ...this.state, frame: 0, colour, cut: scene.cut, follow, ...wanted, run };
    if (!scene.colours.some((one) => one.name === this.state.colour)) this.state.colour = colour;
    this.state.frame = Math.max(0, Math.min(scene.times.length - 1, this.state.frame));
    this.prepare(scene);
    this.curves = new Curves(this.beside, scene, (time) => this.goTo(time));
    this.root.classList.toggle("plain", !scene.frames.length);
    this.root.classList.toggle("bare", !scene.panels.length);
    this.redraw();
  }

  arraysOf(run) {
    this.kept ??= {};
    const text = this.root.querySelector(`script.data[data-run="${run}"]`).textContent;
    return (this.kept[run] ??= unpackArrays(text, this.page.scenes[run].arrays));
  }

  prepare(scene) {
    const c = this.controls, many = scene.times.length > 1, grains = scene.grains && scene.grains.count > 0;
    c.run.value = this.state.run;
    c.time.max = Math.max(0, scene.times.length - 1);
    c.time.disabled = c.play.disabled = !many;
    c.colour.replaceChildren(...scene.colours.map((one) => element("option", { value: one.name, textContent: one.name })));
    c.cut.disabled = !grains || scene.grains.shell;
    c.reset.hidden = !scene.frames.length;
    this.labels.run.hidden = this.page.scenes.length < 2;
    this.labels.colour.hidden = this.labels.cut.hidden = !grains;
    this.labels.follow.hidden = !(scene.bodies || []).length;
    this.notes.textContent = scene.frames.length ? scene.notes.join(" ") : "";
    this.canvas.setAttribute("aria-label", `${this.page.title}, ${scene.title}: picture that the arrow keys move`);
    if (this.picture) this.message.hidden = true;
    if (!scene.frames.length) this.tell(scene.notes.join(" "));
    if (!grains) return;
    const codes = this.arrays.radius.values;
    this.radius = Float32Array.from(codes, (code) => (code / 255) * scene.grains.radius);
  }

  cutAt(share) {
    const { low, high } = this.scene;
    return low[1] + share * (high[1] - low[1]) - (share === 0 ? high[1] - low[1] : 0);
  }

  // Time

  go(frame) {
    this.set({ frame: Math.max(0, Math.min(this.scene.times.length - 1, frame)) });
  }

  goTo(time) {
    const times = this.scene.times;
    let best = 0;
    times.forEach((t, k) => (best = Math.abs(t - time) < Math.abs(times[best] - time) ? k : best));
    this.go(best);
  }

  play(on) {
    const last = this.scene ? this.scene.times.length - 1 : 0;
    this.state.playing = on && last > 0;
    this.controls.play.textContent = this.state.playing ? "Pause" : "Play";
    clearTimeout(this.ticking);
    if (!this.state.playing) return;
    if (this.state.frame >= last) this.state.frame = 0;
    const pause = Math.max(1e3 * FASTEST, 8e3 / (last + 1)); // The whole run in some 8 s.
    const tick = () => {
      this.go(this.state.frame + 1);
      if (this.state.frame >= last) return this.play(false);
      this.ticking = setTimeout(tick, pause);
    };
    this.ticking = setTimeout(tick, pause);
  }

  // Camera

  vectors() {
    const { az, el } = this.state, [sa, ca, se, ce] = [Math.sin(az), Math.cos(az), Math.sin(el), Math.cos(el)];
    return { right: [ca, sa, 0], up: [-sa * se, ca * se, ce], away: [-sa * ce, ca * ce, -se] };
  }

  /** Corners of what the first view contains: bed and bodies in all frames, or with `follow` the bodies in the first. */
  box() {
    return this.state.follow ? this.scene.near : this.scene.far;
  }

  view(width, height) {
    const axes = this.vectors(), [low, high] = this.box(), { state, scene } = this;
    const centre = low.map((l, k) => (l + high[k]) / 2), half = low.map((l, k) => (high[k] - l) / 2);
    const span = (axis) => axis.reduce((sum, a, k) => sum + Math.abs(a) * half[k], 0);
    const tall = (2 * 1.12 * Math.max(span(axes.up), (span(axes.right) * height) / width)) / state.zoom;
    if (state.follow && scene.frames.length)
      scene.frames[state.frame].centre.forEach((c, k) => (centre[k] += c - scene.frames[0].centre[k]));
    for (let k = 0; k < 3; k++) centre[k] -= tall * (state.pan[0] * axes.right[k] + state.pan[1] * axes.up[k]);
    const far = [scene.low, scene.high, low, high].map((corner) => Math.hypot(...corner.map((p, k) => p - centre[k])));
    return { ...axes, centre, tall, reach: 1.1 * Math.max(...far) + tall };
  }

  turn(az, el) {
    this.set({ az: this.state.az + az, el: Math.max(-1.55, Math.min(1.55, this.state.el + el)) });
  }

  zoom(factor) {
    this.set({ zoom: Math.max(0.2, Math.min(60, this.state.zoom * factor)) });
  }

  /** Move the scene to the right and up, over the height of the picture. */
  move(right, up) {
    this.set({ pan: [this.state.pan[0] + right, this.state.pan[1] + up] });
  }

  listenToPointer() {
    const canvas = this.canvas;
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before[0], dy = event.clientY - before[1];
      const others = [...fingers].filter(([id]) => id !== event.pointerId);
      if (others.length) {
        const gap = (at) => Math.hypot(at[0] - others[0][1][0], at[1] - others[0][1][1]);
        this.zoom(gap([event.clientX, event.clientY]) / Math.max(1, gap(before)));
      } else if (event.shiftKey || event.buttons & 2) {
        this.move(dx / canvas.clientHeight, -dy / canvas.clientHeight);
      } else this.turn(-0.008 * dx, 0.008 * dy);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      // In a report the wheel scrolls the page unless the picture has the focus.
      if (!this.root.classList.contains("whole") && document.activeElement !== canvas) return;
      event.preventDefault();
      this.zoom(Math.exp(-0.0012 * event.deltaY));
    }, { passive: false });
  }

  onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
    if (event.target === this.controls.cut && event.key.startsWith("Arrow")) return;
    if (event.key === " " && ["BUTTON", "INPUT"].includes(event.target.tagName) && event.target.type !== "range") return;
    const step = 0.12, turning = event.shiftKey;
    const actions = {
      " ": () => this.play(!this.state.playing),
      ArrowLeft: () => (turning ? this.turn(-step, 0) : this.go(this.state.frame - 1)),
      ArrowRight: () => (turning ? this.turn(step, 0) : this.go(this.state.frame + 1)),
      ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step),
      PageUp: () => this.go(0),
      PageDown: () => this.go(this.scene.times.length - 1),
      Home: () => this.set(structuredClone(FIRST_VIEW)),
      w: () => this.move(0, -0.1),
      a: () => this.move(0.1, 0),
      s: () => this.move(0, 0.1),
      d: () => this.move(-0.1, 0),
      "+": () => this.zoom(1.2),
      "=": () => this.zoom(1.2),
      "-": () => this.zoom(1 / 1.2),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  // Drawing

  set(change) {
    Object.assign(this.state, change);
    this.redraw();
  }

  /** Draw at the next occasion, and once more in full sharpness when nothing has moved for a while. */
  redraw() {
    if (!this.scene || this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.draw(this.ratio);
      clearTimeout(this.sharpening);
      this.sharpening = setTimeout(() => this.draw(Math.max(1.5, window.devicePixelRatio || 1)), 180);
    });
  }

  /** Draw now, with so many pixels for one of the page; the time that it took [s] sets how many while it moves. */
  draw(ratio) {
    const { scene, state, controls: c } = this, time = scene.times[state.frame];
    c.time.value = state.frame;
    c.colour.value = state.colour;
    c.follow.checked = state.follow;
    if (scene.grains) c.cut.value = (100 * (state.cut - scene.low[1])) / (scene.high[1] - scene.low[1]);
    if (time !== undefined) {
      const now = scene.states.find((s) => time >= s.from && time < s.to) || scene.states[scene.states.length - 1];
      c.clock.textContent = `${time.toFixed(3).replace(/^-(0\.0*)$/, "$1")} s${now ? `, ${now.state}` : ""}`;
      this.curves.show(time);
    }
    this.toHash();
    const wide = this.stage.clientWidth, high = this.stage.clientHeight;
    if (!this.picture || !scene.frames.length || !wide || !high) return;
    const began = performance.now(), size = [Math.round(wide * ratio), Math.round(high * ratio)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const view = this.view(wide, high);
    this.picture.draw(view, this.grains(), [...this.ground(), ...this.bodies()], this.palette);
    this.drawOver(view, wide, high);
    this.took = (performance.now() - began) / 1e3;
    if (ratio > this.ratio) return;
    if (this.took > PATIENCE) this.ratio = Math.max(LOWEST, 0.8 * this.ratio);
    else if (this.took < 0.4 * PATIENCE) this.ratio = Math.min(window.devicePixelRatio || 1, 1.1 * this.ratio);
  }

  grains() {
    const { scene, state, arrays } = this;
    if (!scene.grains || !scene.grains.count) return null;
    const colour = arrays[`colour ${state.colour}`];
    return {
      position: arrays.position.at(state.frame), low: scene.grains.low, step: scene.grains.step, radius: this.radius,
      largest: scene.grains.radius, colour: colour ? colour.at(state.frame) : null, cut: state.cut,
    };
  }

  bodies() {
    const { centre, size } = this.scene.frames[this.state.frame];
    return this.scene.bodies.map(({ name, colour }) => {
      const codes = this.arrays[`body ${name}`], from = codes.at(this.state.frame);
      const points = new Float32Array(3 * codes.count), step = (2 * size) / 65535;
      for (let i = 0; i < points.length; i++) points[i] = centre[i % 3] - size + step * from[i];
      return { points, triangles: this.arrays[`triangles ${name}`].values, colour };
    });
  }

  /** The block that stands for a law, translucent for the tips in it, or the floor below the grains. */
  ground() {
    const { scene } = this, { low, high } = scene, thick = 0.03 * (high[2] - low[2]);
    if (!scene.block && !scene.grains.count) return [];
    const [foot, head] = scene.block ? [low[2], high[2]] : [low[2] - thick, low[2] - 0.01 * thick];
    const front = scene.block ? low[1] : Math.min(high[1], Math.max(low[1], this.state.cut));
    const points = new Float32Array(24);
    for (let k = 0; k < 8; k++) points.set([k & 1 ? high[0] : low[0], k & 2 ? high[1] : front, k & 4 ? head : foot], 3 * k);
    const triangles = new Uint32Array([0, 1, 5, 0, 5, 4, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 3, 7, 1, 7, 5, 4, 5, 7, 4, 7, 6, 0, 1, 3, 0, 3, 2]);
    if (scene.block) return [{ points, triangles, colour: this.page.ground, opacity: this.page.opacity }];
    return [{ points, triangles, colour: this.page.floor }];
  }

  drawOver(view, wide, high) {
    const { scene, state, overlay } = this, frame = scene.frames[state.frame];
    overlay.begin(view, wide, high, Math.max(1.5, window.devicePixelRatio || 1));
    if (scene.surface !== null && !scene.block) overlay.surface(scene.low, scene.high, state.cut, scene.surface);
    overlay.forces(frame.arrows, scene.force);
    overlay.scaleBar();
    overlay.axes();
    const colour = scene.colours.find((one) => one.name === state.colour);
    if (colour && scene.grains.count) overlay.colourScale(this.palette, colour);
  }

  tell(words) {
    this.message.textContent = words;
    this.message.hidden = false;
  }

  // The state in the address, so that a view can be sent and a page that reloads keeps it

  fromHash() {
    if (!this.root.classList.contains("whole")) return {};
    const given = new URLSearchParams(location.hash.slice(1)), found = {};
    for (const name of ["run", "frame", "az", "el", "zoom", "cut"])
      if (given.has(name) && Number.isFinite(+given.get(name))) found[name] = +given.get(name);
    if (given.get("frame") === "last") found.frame = Infinity;
    if (given.has("colour")) found.colour = given.get("colour");
    return found;
  }

  toHash() {
    if (!this.root.classList.contains("whole") || this.state.playing) return;
    const { run, frame, az, el, zoom, colour, cut } = this.state;
    const last = this.page.live && frame === this.scene.times.length - 1;
    const round = (value) => String(+value.toFixed(5));
    const text = new URLSearchParams({ run, frame: last ? "last" : frame, az: round(az), el: round(el), zoom: round(zoom), cut: round(cut), colour });
    clearTimeout(this.writing);
    this.writing = setTimeout(() => history.replaceState(null, "", `#${text}`), 250);
  }
}

/** Start every scene of the page, in a report only when it comes into sight. */
function startScenes() {
  const sight = new IntersectionObserver((entries) => {
    for (const entry of entries)
      if (entry.isIntersecting) {
        sight.unobserve(entry.target);
        entry.target.viewer = new Viewer(entry.target);
      }
  }, { rootMargin: "200px" });
  for (const root of document.querySelectorAll(".scene")) {
    if (!root.classList.contains("whole")) {
      sight.observe(root);
      continue;
    }
    root.viewer = new Viewer(root);
    root.viewer.canvas.focus({ preventScroll: true });
    const live = root.viewer.page.live;
    if (live) setTimeout(() => location.reload(), 1e3 * live);
  }
}
startScenes();
