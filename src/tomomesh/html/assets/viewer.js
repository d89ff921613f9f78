/**
 * The 3-D view of tomomesh, over the global THREE (three.js r140 with TrackballControls).
 *
 * A classic script, or `import "./viewer.js"` for its effect: it sets the one global `tomomeshViewer`:
 *
 *   decodeScene(buffer)            ArrayBuffer of `Scene.packed()` -> scene
 *   createViewer(element, options) -> viewer, or null where there is no THREE or no WebGL: show a picture then
 *     options: {dark: boolean, wheel: "always" | "focused"}   "focused" (default): the page scrolls until one clicks
 *
 * What a viewer does; places and planes are in the numbers of the mesh (millimeters of the patient):
 *   show(scene, {keep})            draw a scene in place of the last; keep: where the camera is
 *   setColors(values, options)     color vertices by Float32Array, null for none; {title, unit, low, high}
 *   setWire(on)                    edges over the faces
 *   setShaded(on)                  the faces themselves
 *   fly(place, radius)             look at [x, y, z], and mark it
 *   clip(plane)                    {normal: [x, y, z], offset}: keep where normal . p >= offset; null for all
 *   setLines(name, ends, color)    draw segments, Float32Array of pairs of places; null takes them away
 *   setDark(on)
 *   look(axis)                     "x-", "x+", "y-", "y+", "z-" or "z+": from that side
 *   fit()                          all of it, from the front
 *   redraw()                       after the element has come into sight
 *   dispose()
 *
 * Keys, where the view has the focus: arrows turn, with Shift they move; + and - zoom; F fits, W shows edges.
 * The element should have a size; it gets a canvas, letters and a legend, of classes view-canvas, view-letter,
 * view-legend.
 */
(() => {
  "use strict";

  const TURN = Math.PI / 18;
  const SURFACES = { light: { back: 0xf4f6f8, face: 0xd9c9a8, edge: 0x22303c }, dark: { back: 0x14191e, face: 0xd9c9a8, edge: 0x0b0f13 } };
  const MARK = "#d55e00";
  // viridis (Smith & van der Walt 2015, CC0): rises evenly in lightness, so that no color vision is needed
  const VIRIDIS = [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37]];
  const UNKNOWN = [150, 150, 150];

  /**
   * Read the bytes of a scene.
   * @param {ArrayBuffer} buffer
   * @returns {{header: object, center: number[], positions: Float32Array, faces: Uint16Array|Uint32Array,
   *   lines: Uint16Array|Uint32Array, values: Object<string, Float32Array>}} positions are counted from the center
   */
  function decodeScene(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let at = 4 + length;
    const take = (Type, count) => {
      const part = new Type(buffer, at, count);
      at += Math.ceil(part.byteLength / 4) * 4;
      return part;
    };
    const Index = header.index_bytes === 2 ? Uint16Array : Uint32Array;
    const stored = take(Uint16Array, 3 * header.vertices);
    const faces = take(Index, 3 * header.faces);
    const lines = take(Index, 2 * header.lines);
    const values = {};
    for (const told of header.values) values[told.name] = take(Float32Array, header.vertices);
    return { header, faces, lines, values, ...centered(stored, header) };
  }

  function centered(stored, { low, step }) {
    const most = [0, 0, 0];
    for (let n = 0; n < stored.length; n += 1) most[n % 3] = Math.max(most[n % 3], stored[n]);
    const half = most.map((value) => value / 2);
    const positions = new Float32Array(stored.length);
    for (let n = 0; n < stored.length; n += 1) positions[n] = step * (stored[n] - half[n % 3]);
    return { positions, center: low.map((value, n) => value + step * half[n]), half: half.map((value) => step * value) };
  }

  /** Return the color of a share from 0 to 1, three numbers up to 255. */
  function colorOf(share) {
    if (!Number.isFinite(share)) return UNKNOWN;
    const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
    const n = Math.min(Math.floor(place), VIRIDIS.length - 2);
    return VIRIDIS[n].map((value, k) => value + (place - n) * (VIRIDIS[n + 1][k] - value));
  }

  /** Create a view in an element; null where it cannot be. */
  function createViewer(element, { dark = false, wheel = "focused" } = {}) {
    if (typeof THREE === "undefined" || !THREE.TrackballControls) return null;
    const canvas = document.createElement("canvas");
    const wanted = { antialias: true, preserveDrawingBuffer: true };
    const context = canvas.getContext("webgl2", wanted) || canvas.getContext("webgl", wanted);
    return context ? new Viewer(element, canvas, context, dark, wheel) : null;
  }

  class Viewer {
    constructor(element, canvas, context, dark, wheel) {
      this.element = element;
      this.renderer = new THREE.WebGLRenderer({ canvas, context });
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
      this.canvas = this.renderer.domElement;
      this.canvas.className = "view-canvas";
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", "The mesh in 3-D. Arrows turn it, plus and minus zoom, F shows all of it.");
      element.append(this.canvas);
      this.stage = new THREE.Scene();
      this.body = new THREE.Group();
      this.stage.add(this.body);
      this.camera = new THREE.PerspectiveCamera(30, 1, 0.1, 10000);
      this.addLights();
      this.stage.add(this.camera);
      this.planes = [];
      this.lines = new Map();
      this.wire = false;
      this.shaded = true;
      this.letters = [];
      this.controls = this.addControls(wheel);
      this.legend = addLegend(element);
      this.mark = markOf();
      this.stage.add(this.mark);
      this.setDark(dark);
      this.sized = new ResizeObserver(() => this.resize());
      this.sized.observe(element);
      this.resize();
    }

    addLights() {
      const key = new THREE.DirectionalLight(0xffffff, 0.75);
      key.position.set(-0.6, 0.8, 1);
      this.camera.add(key);
      this.camera.add(key.target);
      key.target.position.set(0, 0, -1);
      this.stage.add(new THREE.HemisphereLight(0xffffff, 0x8890a0, 0.45));
    }

    addControls(wheel) {
      const controls = new THREE.TrackballControls(this.camera, this.canvas);
      Object.assign(controls, { staticMoving: true, rotateSpeed: 3, zoomSpeed: 1.2, panSpeed: 0.4, keys: [], noZoom: wheel === "focused" });
      this.heard = [
        ["keydown", (event) => this.key(event)],
        ["focus", () => { controls.noZoom = false; }],
        ["blur", () => { controls.noZoom = wheel === "focused"; }],
        ["pointermove", () => this.later()],
        ["wheel", () => this.later(), { passive: true }],
      ];
      for (const heard of this.heard) this.canvas.addEventListener(...heard);
      return controls;
    }

    show(scene, { keep = false } = {}) {
      this.scene = scene;
      this.empty();
      this.geometry = geometryOf(scene);
      this.faces = scene.faces.length ? this.addFaces(scene) : null;
      this.edges = this.addEdges(scene);
      this.dots = scene.faces.length || scene.lines.length ? null : this.addDots();
      this.size = 2 * Math.hypot(...scene.half) || 1;
      this.mark.visible = false;
      this.setColors(null);
      this.addLetters(scene);
      this.dress();
      if (!keep || !this.shown) this.fit();
      this.shown = true;
      this.later();
    }

    addFaces(scene) {
      const material = new THREE.MeshPhongMaterial({
        side: THREE.DoubleSide, flatShading: Boolean(scene.header.flat), shininess: 12, specular: 0x222222,
        polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      });
      const faces = new THREE.Mesh(this.geometry, material);
      this.body.add(faces);
      return faces;
    }

    addEdges(scene) {
      const between = { transparent: true, opacity: 0.45 };
      let edges = null;
      if (scene.lines.length) {
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", this.geometry.getAttribute("position"));
        geometry.setIndex(new THREE.BufferAttribute(scene.lines, 1));
        edges = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(between));
      } else if (scene.faces.length) {
        edges = new THREE.Mesh(this.geometry, new THREE.MeshBasicMaterial({ wireframe: true, ...between }));
      }
      if (edges) this.body.add(edges);
      return edges;
    }

    addDots() {
      const dots = new THREE.Points(this.geometry, new THREE.PointsMaterial({ size: 3, sizeAttenuation: false }));
      this.body.add(dots);
      return dots;
    }

    empty() {
      for (const child of [...this.body.children]) {
        this.body.remove(child);
        child.geometry.dispose();
        child.material.dispose();
      }
      this.lines.clear();
    }

    /** Give all materials the colors of light or dark, the planes that clip, and what is to be seen. */
    dress() {
      const colors = this.dark ? SURFACES.dark : SURFACES.light;
      this.renderer.setClearColor(colors.back);
      this.renderer.localClippingEnabled = this.planes.length > 0;
      for (const child of this.body.children) child.material.clippingPlanes = this.planes;
      for (const one of [this.faces, this.dots]) {
        if (!one) continue;
        one.material.vertexColors = this.colored;
        one.material.color.set(this.colored ? 0xffffff : one === this.dots ? (this.dark ? 0xe6eaee : 0x22303c) : colors.face);
        one.material.needsUpdate = true;
      }
      if (this.faces) this.faces.visible = this.shaded;
      if (this.edges) {
        this.edges.visible = this.wire || !this.shaded;
        this.edges.material.color.set(this.shaded || !this.dark ? colors.edge : 0xb8c4ce);
      }
      this.later();
    }

    setColors(values, { title = "", unit = "", low = 0, high = 1 } = {}) {
      this.colored = Boolean(values);
      if (values) {
        const colors = new Uint8Array(3 * values.length);
        const range = high - low || 1;
        for (let n = 0; n < values.length; n += 1) colors.set(colorOf((values[n] - low) / range), 3 * n);
        this.geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3, true));
      }
      tellLegend(this.legend, values ? { title, unit, low, high } : null);
      this.dress();
    }

    setWire(on) {
      this.wire = Boolean(on);
      this.dress();
    }

    setShaded(on) {
      this.shaded = Boolean(on);
      this.dress();
    }

    setDark(on) {
      this.dark = Boolean(on);
      this.dress();
    }

    clip(plane) {
      this.planes = [];
      if (plane) {
        const normal = new THREE.Vector3(...plane.normal);
        this.planes = [new THREE.Plane(normal, normal.dot(new THREE.Vector3(...this.scene.center)) - plane.offset)];
      }
      this.dress();
    }

    setLines(name, ends, color = MARK) {
      const old = this.lines.get(name);
      if (old) {
        this.body.remove(old);
        old.geometry.dispose();
        old.material.dispose();
        this.lines.delete(name);
      }
      if (ends && ends.length) {
        const { center } = this.scene;
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(ends, (value, n) => value - center[n % 3]), 3));
        const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color, depthTest: false }));
        this.lines.set(name, lines);
        this.body.add(lines);
      }
      this.later();
    }

    fly(place, radius = 0) {
      const { center } = this.scene;
      const target = new THREE.Vector3(...place.map((value, n) => value - center[n]));
      const outward = target.clone();
      if (outward.length() < 0.02 * this.size) outward.subVectors(this.camera.position, this.controls.target);
      const far = Math.max(Math.min(8 * radius, this.size), 2.5 * radius, 0.35 * this.size);
      const eye = outward.normalize().multiplyScalar(far).add(target);
      this.mark.position.copy(target);
      this.mark.visible = true;
      this.travel(eye, target, upright(outward, this.camera.up));
    }

    travel(eye, target, up) {
      const from = { eye: this.camera.position.clone(), target: this.controls.target.clone() };
      this.camera.up.copy(up);
      const whole = window.matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 450;
      const start = performance.now();
      const step = (now) => {
        const part = whole ? Math.min(Math.max((now - start) / whole, 0), 1) : 1;
        const eased = part * part * (3 - 2 * part);
        this.camera.position.lerpVectors(from.eye, eye, eased);
        this.controls.target.lerpVectors(from.target, target, eased);
        this.draw();
        this.traveling = part < 1 ? requestAnimationFrame(step) : 0;
      };
      cancelAnimationFrame(this.traveling);
      this.traveling = requestAnimationFrame(step);
    }

    fit() {
      this.mark.visible = false;
      this.lookAlong(new THREE.Vector3(0.45, -1, 0.3), new THREE.Vector3(0, 0, 1));
    }

    look(axis) {
      const direction = new THREE.Vector3();
      direction[axis[0]] = axis[1] === "-" ? -1 : 1;
      this.lookAlong(direction, axis[0] === "z" ? new THREE.Vector3(0, -1, 0) : new THREE.Vector3(0, 0, 1));
    }

    lookAlong(direction, up) {
      cancelAnimationFrame(this.traveling);
      const narrow = Math.min(1, this.camera.aspect);
      const far = (0.41 * this.size) / Math.sin((this.camera.fov * Math.PI) / 360) / narrow;
      this.controls.target.set(0, 0, 0);
      this.camera.up.copy(up);
      this.camera.position.copy(direction.normalize().multiplyScalar(far));
      this.later();
    }

    key(event) {
      const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key in turns) this[event.shiftKey ? "pan" : "turn"](...turns[event.key]);
      else if (event.key === "+" || event.key === "=") this.zoom(1 / 1.15);
      else if (event.key === "-") this.zoom(1.15);
      else if (event.key.toLowerCase() === "f") this.fit();
      else if (event.key.toLowerCase() === "w") this.setWire(!this.wire);
      else return;
      event.preventDefault();
    }

    axes() {
      const eye = this.camera.position.clone().sub(this.controls.target);
      const across = this.camera.up.clone().cross(eye).normalize();
      return { eye, across, up: eye.clone().cross(across).normalize() };
    }

    turn(right, up) {
      const { eye, across, up: upward } = this.axes();
      eye.applyAxisAngle(upward, -right * TURN).applyAxisAngle(across, -up * TURN);
      this.camera.up.copy(upward).applyAxisAngle(across, -up * TURN);
      this.camera.position.copy(eye.add(this.controls.target));
      this.later();
    }

    pan(right, up) {
      const { across, up: upward } = this.axes();
      const moved = across.multiplyScalar(right * 0.04 * this.size).add(upward.multiplyScalar(up * 0.04 * this.size));
      this.camera.position.sub(moved);
      this.controls.target.sub(moved);
      this.later();
    }

    zoom(by) {
      this.camera.position.sub(this.controls.target).multiplyScalar(by).add(this.controls.target);
      this.later();
    }

    addLetters(scene) {
      for (const { label } of this.letters) label.remove();
      this.letters = scene.header.axes.flatMap((ends, axis) => ends.map((name, end) => {
        const label = document.createElement("span");
        label.className = "view-letter";
        label.textContent = name;
        label.setAttribute("aria-hidden", "true");
        this.element.append(label);
        const place = new THREE.Vector3().setComponent(axis, (end ? 1 : -1) * (scene.half[axis] + 0.03 * this.size));
        return { label, place };
      }));
    }

    placeLetters() {
      const [width, height] = [this.element.clientWidth, this.element.clientHeight];
      for (const { label, place } of this.letters) {
        const seen = place.clone().project(this.camera);
        const [x, y] = [(seen.x + 1) / 2, (1 - seen.y) / 2];
        label.hidden = x < 0.02 || x > 0.98 || y < 0.03 || y > 0.97 || seen.z > 1;
        label.classList.toggle("view-far", place.dot(this.camera.position) < 0);
        label.style.transform = `translate(-50%, -50%) translate(${(x * width).toFixed(1)}px, ${(y * height).toFixed(1)}px)`;
      }
    }

    resize() {
      const [width, height] = [this.element.clientWidth || 1, this.element.clientHeight || 1];
      this.renderer.setSize(width, height);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.controls.handleResize();
      this.draw();
    }

    /** Draw at the next frame, once however often it is asked for. */
    later() {
      if (!this.asked) this.asked = requestAnimationFrame(() => this.draw());
    }

    redraw() {
      this.resize();
    }

    draw() {
      this.asked = 0;
      if (!this.controls) return;
      this.controls.handleResize(); // the page may have scrolled
      this.controls.update();
      const far = this.camera.position.length() + (this.size || 1);
      this.camera.near = Math.max(far - 2.2 * (this.size || 1), far / 2000);
      this.camera.far = 1.2 * far;
      this.camera.updateProjectionMatrix();
      this.renderer.render(this.stage, this.camera);
      this.placeLetters();
    }

    dispose() {
      cancelAnimationFrame(this.asked);
      cancelAnimationFrame(this.traveling);
      this.sized.disconnect();
      for (const [name, hear] of this.heard) this.canvas.removeEventListener(name, hear);
      this.empty();
      this.controls.dispose();
      this.renderer.dispose();
      for (const { label } of this.letters) label.remove();
      this.legend.remove();
      this.canvas.remove();
    }
  }

  function geometryOf(scene) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(scene.positions, 3));
    if (scene.faces.length) {
      geometry.setIndex(new THREE.BufferAttribute(scene.faces, 1));
      geometry.computeVertexNormals();
    }
    return geometry;
  }

  /** Return an upward direction that is not the one that is looked along. */
  function upright(direction, up) {
    const unit = direction.clone().normalize();
    if (Math.abs(unit.dot(up)) < 0.95) return up.clone();
    return Math.abs(unit.z) < 0.95 ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(0, 1, 0);
  }

  /** A ring that is seen through everything, always as large. */
  function markOf() {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    const pen = canvas.getContext("2d");
    for (const [width, color] of [[12, "#ffffff"], [7, MARK]]) {
      pen.lineWidth = width;
      pen.strokeStyle = color;
      pen.beginPath();
      pen.arc(32, 32, 24, 0, 2 * Math.PI);
      pen.stroke();
    }
    const map = new THREE.CanvasTexture(canvas);
    const mark = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthTest: false, sizeAttenuation: false }));
    mark.scale.setScalar(0.035);
    mark.renderOrder = 10;
    mark.visible = false;
    return mark;
  }

  function addLegend(element) {
    const legend = document.createElement("div");
    legend.className = "view-legend";
    legend.hidden = true;
    const bar = document.createElement("canvas");
    [bar.width, bar.height] = [160, 10];
    const pen = bar.getContext("2d");
    for (let x = 0; x < bar.width; x += 1) {
      pen.fillStyle = `rgb(${colorOf(x / (bar.width - 1)).map(Math.round).join(",")})`;
      pen.fillRect(x, 0, 1, bar.height);
    }
    legend.append(...["title", "low", "high"].map((name) => {
      const text = document.createElement("span");
      text.className = `view-legend-${name}`;
      return text;
    }));
    legend.firstChild.after(bar);
    element.append(legend);
    return legend;
  }

  function tellLegend(legend, told) {
    legend.hidden = !told;
    if (!told) return;
    const [title, , low, high] = legend.children;
    title.textContent = told.title + (told.unit ? ` (${told.unit})` : "");
    low.textContent = Number(told.low.toPrecision(3));
    high.textContent = `${Number(told.high.toPrecision(3))} and more`;
  }

  globalThis.tomomeshViewer = { createViewer, decodeScene, colorOf };
})();
