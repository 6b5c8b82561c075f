// The picture of one frame: grains as exact spheres, bodies as meshes, through a camera without perspective.
//
// A grain is a square of two triangles, and its shader computes the sphere. Before that, grains that others hide are
// left out: front to back, each grain marks the cells of the screen that its disc fills, and one that finds all of its
// cells marked is not drawn. Of a bed of 100,000 grains some 5,000 to 15,000 remain, which software can draw.

const GRAIN_VERTEX = `#version 300 es
layout(location = 0) in vec4 grain;  // right, up, away [m], radius [m]
layout(location = 1) in vec4 colour;
uniform vec3 scale;
out vec2 corner;
out vec4 tint;
out vec2 deep;
void main() {
  corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  tint = colour;
  deep = vec2(grain.z, grain.w) * scale.z;
  gl_Position = vec4((grain.xy + corner * grain.w) * scale.xy, grain.z * scale.z, 1.0);
}`;
const GRAIN_FRAGMENT = `#version 300 es
precision highp float;
in vec2 corner;
in vec4 tint;
in vec2 deep;
out vec4 pixel;
void main() {
  float square = dot(corner, corner);
  if (square > 1.0) discard;
  float height = sqrt(1.0 - square);
  gl_FragDepth = 0.5 + 0.5 * (deep.x - deep.y * height);
  float light = max(0.0, dot(vec3(corner, height), vec3(-0.40, 0.62, 0.675)));
  pixel = vec4(tint.rgb * (0.42 + 0.58 * light) * (0.72 + 0.28 * height), 1.0);
}`;
const BODY_VERTEX = `#version 300 es
layout(location = 0) in vec3 point;
uniform mat3 turn;
uniform vec3 centre;
uniform vec3 scale;
out vec3 seen;
void main() {
  seen = turn * (point - centre);
  gl_Position = vec4(seen * scale, 1.0);
}`;
const BODY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 seen;
uniform vec4 colour;  // its fourth part is the opacity
out vec4 pixel;
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));  // of the triangle; away is its third component
  if (normal.z > 0.0) normal = -normal;
  float light = max(0.0, dot(normal, vec3(-0.40, 0.62, -0.675)));
  pixel = vec4(colour.rgb * (0.55 + 0.5 * light), colour.a);
}`;

/** Cells of the screen at most. */
const MOST_CELLS = 4e6;

class Picture {
  /** Draws on a canvas. Throws an Error where the browser has no WebGL 2. */
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: false });
    if (!this.gl) throw new Error("no WebGL 2");
    const gl = this.gl;
    this.grains = this.program(GRAIN_VERTEX, GRAIN_FRAGMENT, ["scale"]);
    this.bodies = this.program(BODY_VERTEX, BODY_FRAGMENT, ["turn", "centre", "scale", "colour"]);
    [this.vertices, this.squares, this.points, this.triangles] = [0, 1, 2, 3].map(() => gl.createBuffer());
    this.capacity = 0;
    this.drawn = 0;
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    gl.clearColor(1, 1, 1, 1);
  }

  program(vertex, fragment, names) {
    const gl = this.gl, made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    return { made, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
  }

  /** Room for so many grains: their order by depth, their vertices, the corners of their squares. */
  reserve(count) {
    if (count <= this.capacity) return;
    this.capacity = count;
    this.seen = new Float32Array(3 * count);
    this.rank = new Uint16Array(count);
    this.order = new Uint32Array(count);
    this.list = new Uint32Array(count);
    this.floats = new Float32Array(20 * count);
    this.inks = new Uint32Array(this.floats.buffer);
    const corners = new Uint32Array(6 * count);
    for (let i = 0; i < count; i++) corners.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    this.gl.bindBuffer(this.gl.ELEMENT_ARRAY_BUFFER, this.squares);
    this.gl.bufferData(this.gl.ELEMENT_ARRAY_BUFFER, corners, this.gl.STATIC_DRAW);
  }

  /**
   * Draw a frame and wait until it is there.
   * view: right, up, away (unit vectors), centre [m], tall (height of the picture [m]), reach (half depth [m]).
   * grains: position (codes), low [m], step [m], radius [m] of each, colour (code of each, or null), cut (y) [m].
   * bodies: points [m], triangles, colour and opacity (1 if not given) of each. palette: a 32-bit colour for each code.
   * Translucent bodies come last: what lies in them shows through their nearest face.
   */
  draw(view, grains, bodies, palette) {
    const gl = this.gl, { width, height } = this.canvas;
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const scale = [(2 / view.tall) * (height / width), 2 / view.tall, 1 / view.reach];
    const clear = ({ opacity = 1 }) => opacity < 1;
    this.drawBodies(view, bodies.filter((body) => !clear(body)), scale);
    this.drawn = grains ? this.drawGrains(view, grains, scale, palette) : 0;
    for (const body of bodies.filter(clear)) this.drawClear(view, body, scale);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** Its depths first and then its colour, so that one of its faces is mixed in at each place, whatever their order. */
  drawClear(view, body, scale) {
    const gl = this.gl;
    gl.colorMask(false, false, false, false);
    this.drawBodies(view, [body], scale);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.BLEND);
    this.drawBodies(view, [body], scale);
    gl.disable(gl.BLEND);
  }

  drawBodies(view, bodies, scale) {
    const gl = this.gl, { made, at } = this.bodies;
    gl.useProgram(made);
    gl.disableVertexAttribArray(1);
    gl.uniformMatrix3fv(at.turn, true, [...view.right, ...view.up, ...view.away]);
    gl.uniform3fv(at.centre, view.centre);
    gl.uniform3fv(at.scale, scale);
    for (const body of bodies) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
      gl.bufferData(gl.ARRAY_BUFFER, body.points, gl.STREAM_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, body.triangles, gl.STREAM_DRAW);
      gl.uniform4fv(at.colour, [...body.colour, body.opacity ?? 1]);
      gl.drawElements(gl.TRIANGLES, body.triangles.length, gl.UNSIGNED_INT, 0);
    }
  }

  drawGrains(view, grains, scale, palette) {
    const gl = this.gl, { made, at } = this.grains;
    this.reserve(grains.radius.length);
    const count = this.hide(this.sort(view, grains), view, grains);
    const { floats, inks, seen, list } = this;
    for (let k = 0, to = 0; k < count; k++) {
      const i = list[k], ink = palette[grains.colour ? grains.colour[i] : 0];
      for (let corner = 0; corner < 4; corner++, to += 5) {
        floats[to] = seen[3 * i];
        floats[to + 1] = seen[3 * i + 1];
        floats[to + 2] = seen[3 * i + 2];
        floats[to + 3] = grains.radius[i];
        inks[to + 4] = ink;
      }
    }
    gl.useProgram(made);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
    gl.bufferData(gl.ARRAY_BUFFER, floats.subarray(0, 20 * count), gl.STREAM_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 20, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 20, 16);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.squares);
    gl.uniform3fv(at.scale, scale);
    gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 0);
    return count;
  }

  /** Grains behind the cut and inside the picture, front to back, in `order`. Returns how many. */
  sort(view, grains) {
    const { right, up, away, centre, tall, reach } = view, { position, low, step, radius, cut } = grains;
    const { seen, rank, order, list } = this;
    const base = [right, up, away].map((axis) => axis.reduce((sum, a, k) => sum + a * (low[k] - centre[k]), 0));
    const halfTall = tall / 2, halfWide = (halfTall * this.canvas.width) / this.canvas.height;
    const bins = new Uint32Array(4097), first = Math.ceil((cut - low[1]) / step);
    let count = 0;
    for (let i = 0; i < radius.length; i++) {
      const x = step * position[3 * i], y = step * position[3 * i + 1], z = step * position[3 * i + 2];
      if (position[3 * i + 1] < first) continue;
      const a = base[0] + right[0] * x + right[1] * y + right[2] * z, b = base[1] + up[0] * x + up[1] * y + up[2] * z;
      if (Math.abs(a) > halfWide + radius[i] || Math.abs(b) > halfTall + radius[i]) continue;
      const c = base[2] + away[0] * x + away[1] * y + away[2] * z;
      seen[3 * i] = a;
      seen[3 * i + 1] = b;
      seen[3 * i + 2] = c;
      rank[i] = Math.max(0, Math.min(4095, 2048 * (1 + c / reach)));
      bins[rank[i] + 1]++;
      list[count++] = i;
    }
    for (let k = 1; k < 4097; k++) bins[k] += bins[k - 1];
    for (let k = 0; k < count; k++) order[bins[rank[list[k]]]++] = list[k];
    return count;
  }

  /** Of the first `count` grains in `order` those that are not hidden, in `list`. Returns how many. */
  hide(count, view, grains) {
    const { seen, order, list } = this, { width, height } = this.canvas;
    const perMetre = height / view.tall;
    const cell = Math.max((grains.largest * perMetre) / 3, Math.sqrt((width * height) / MOST_CELLS));
    const wide = Math.ceil(width / cell), high = Math.ceil(height / cell), filled = new Uint8Array(wide * high);
    const scale = perMetre / cell, midX = width / 2 / cell, midY = height / 2 / cell;
    let kept = 0;
    for (let k = 0; k < count; k++) {
      const i = order[k], x = midX + scale * seen[3 * i], y = midY + scale * seen[3 * i + 1];
      const r = scale * grains.radius[i], square = r * r;
      const left = Math.max(0, Math.floor(x - r)), last = Math.min(wide - 1, Math.floor(x + r));
      const top = Math.min(high - 1, Math.floor(y + r));
      let visible = false;
      for (let row = Math.max(0, Math.floor(y - r)); row <= top; row++) {
        const dy = Math.max(Math.abs(row - y), Math.abs(row + 1 - y));
        for (let column = left; column <= last; column++) {
          if (filled[row * wide + column]) continue;
          visible = true;
          const dx = Math.max(Math.abs(column - x), Math.abs(column + 1 - x));
          if (dx * dx + dy * dy <= square) filled[row * wide + column] = 1;
        }
      }
      if (visible) list[kept++] = i;
    }
    return kept;
  }
}
