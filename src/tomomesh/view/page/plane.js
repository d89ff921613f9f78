/** One plane of the study: a slice with what is kept of it, the crosshair, and what a pointer or a key does there. */
import { eachFrame, el, short } from "./dom.js";
import { goTo, inPatient, isLabels, look, looked, unit } from "./looked.js";
import { LINES, drawBox, drawCross, drawLetters, drawScale, placed, pointOf, under } from "./marks.js";
import { paint, paintOver } from "./painting.js";
import { chooseBox, outsideOf } from "./region.js";
import { on, state, tell } from "./store.js";

const AHEAD = 4;
const MOST_ZOOM = 16;
/** Slices are painted by the processor: to hand each to the graphics card costs twice the time where that is emulated. */
const PAINTED = { willReadFrequently: true };

/** A plane of the study; `grays`, `keeps` and `maps` fetch its slices, `tables` leads to colors, `pick` takes a click on a voxel. */
export class Plane {
  /** @param {string} name @param {{grays: any, keeps: any, maps: any, tables: () => any, indices: (values: any) => any, pick: (place: number[]) => void, largest: (name: string) => void}} having */
  constructor(name, having) {
    Object.assign(this, { name, ...having, zoom: { zoom: 1, x: 0.5, y: 0.5 }, drag: null, way: 1, image: null });
    this.canvas = el("canvas", { tabindex: 0, role: "slider", "aria-label": `${name} slice`, "aria-orientation": "vertical" });
    this.caption = el("span", { class: "caption" });
    const larger = el("button", { type: "button", class: "larger", title: "Larger or smaller (M)", "aria-label": `${name}: larger or smaller`, onclick: () => this.largest(name) }, "⤢");
    this.element = el("figure", { class: `plane plane-${name}` }, this.canvas, this.caption, larger);
    this.draw = eachFrame(() => this.#draw());
    this.move = eachFrame(() => this.#move());
    this.#listen();
    on("look", this.draw);
    on("at", this.move);
    new ResizeObserver(this.draw).observe(this.element);
  }

  get plane() { return looked.geometry?.planes[this.name]; }
  get k() { return looked.at[this.plane.axis]; }

  /** Go on by some slices. @param {number} step */
  step(step) {
    this.way = Math.sign(step);
    const place = [...looked.at];
    place[this.plane.axis] += step;
    goTo(place);
  }

  #listen() {
    const { canvas } = this;
    canvas.onwheel = (event) => this.#wheel(event);
    canvas.onpointerdown = (event) => this.#down(event);
    canvas.onpointermove = (event) => this.#over(event);
    canvas.onpointerup = canvas.onpointercancel = () => this.#up();
    canvas.onpointerleave = () => tell("under", { line: "" });
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.ondblclick = (event) => this.pick(this.#voxel(event));
    canvas.onfocus = () => tell("active", { name: this.name });
  }

  #wheel(event) {
    event.preventDefault();
    if (event.ctrlKey) this.zoomBy(event.deltaY < 0 ? 1.25 : 0.8, event);
    else this.step(event.deltaY < 0 ? 1 : -1);
  }

  /** Draw larger around a point, or the middle. @param {number} factor @param {any} [around] */
  zoomBy(factor, around = undefined) {
    const { zoom } = this;
    const room = this.#room();
    const [x, y] = around ? [around.offsetX, around.offsetY] : [room.width / 2, room.height / 2];
    const before = placed(this.plane, room, zoom);
    const at = [(x - before.left) / before.width, (y - before.top) / before.height];
    zoom.zoom = Math.min(Math.max(zoom.zoom * factor, 1), MOST_ZOOM);
    const after = placed(this.plane, room, zoom);
    zoom.x = zoom.zoom === 1 ? 0.5 : at[0] - (x - room.width / 2) / after.width;
    zoom.y = zoom.zoom === 1 ? 0.5 : at[1] - (y - room.height / 2) / after.height;
    this.draw();
  }

  #room() { return { width: this.canvas.clientWidth, height: this.canvas.clientHeight }; }
  #lie() { return placed(this.plane, this.#room(), this.zoom); }

  #voxel({ offsetX, offsetY }) {
    const { rows, columns } = this.plane;
    const [row, column] = under(this.#lie(), offsetX, offsetY).map(Math.floor);
    const place = [...looked.at];
    place[rows] = row;
    place[columns] = column;
    return place;
  }

  #down(event) {
    const kind = event.button === 2 ? "contrast" : event.button === 1 ? "pan" : event.shiftKey ? "box" : looked.tool;
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { kind, from: [event.offsetX, event.offsetY], to: [event.offsetX, event.offsetY], contrast: { ...looked.contrast }, zoom: { ...this.zoom } };
    if (kind === "cross") goTo(this.#voxel(event));
    if (kind === "pick") this.pick(this.#voxel(event));
  }

  #over(event) {
    this.#say(this.#voxel(event));
    if (!this.drag) return;
    this.drag.to = [event.offsetX, event.offsetY];
    const [dx, dy] = [0, 1].map((n) => this.drag.to[n] - this.drag.from[n]);
    if (this.drag.kind === "cross") goTo(this.#voxel(event));
    else if (this.drag.kind === "contrast") this.#contrast(dx, dy);
    else if (this.drag.kind === "pan") this.#pan(dx, dy);
    this.draw();
  }

  #up() {
    const { drag } = this;
    this.drag = null;
    if (drag?.kind === "box") this.#box(drag);
    this.draw();
  }

  #box({ from, to }) {
    if (Math.abs(to[0] - from[0]) < 3 || Math.abs(to[1] - from[1]) < 3) return;
    const lie = this.#lie();
    chooseBox(this.plane, under(lie, ...from), under(lie, ...to));
  }

  #contrast(dx, dy) {
    const { center, width } = this.drag.contrast;
    looked.contrast = { center: center + (dy * width) / 200, width: width * Math.exp(dx / 150) };
    look();
  }

  #pan(dx, dy) {
    const lie = this.#lie();
    this.zoom.x = this.drag.zoom.x - dx / lie.width;
    this.zoom.y = this.drag.zoom.y - dy / lie.height;
  }

  #say(place) {
    const { rows, columns, size } = this.plane;
    const [row, column] = [place[rows], place[columns]];
    const slice = this.grays.have(this.name, this.k);
    if (!slice || row < 0 || column < 0 || row >= size[0] || column >= size[1]) return tell("under", { line: "" });
    const layers = looked.geometry.layers;
    const first = (row * size[1] + column) * layers;
    const levels = [...slice.values.subarray(first, first + layers)].map((one) => short(one, 5)).join(", ");
    const mm = inPatient(place).map((one) => one.toFixed(1)).join(", ");
    const name = isLabels() ? ` ${looked.survey.label_names[levels] || ""}` : unit();
    const label = looked.geometry.labelled ? this.maps.have(this.name, this.k)?.values[row * size[1] + column] : 0;
    const number = this.keeps.have(this.name, this.k)?.values[row * size[1] + column];
    return tell("under", { line: `${levels}${name} at ${mm} mm${label ? `, label ${label} ${looked.survey?.label_names[label] || ""}` : ""}${number ? `, component ${number === 255 ? "255 or smaller" : number}` : ""}` });
  }

  async #move() {
    if (!this.plane) return;
    const { name, k } = this;
    this.draw();
    await Promise.all([this.grays.fetch(name, k), looked.kept && this.keeps.fetch(name, k), looked.geometry.labelled && this.maps.fetch(name, k)]);
    if (k !== this.k) return;
    this.draw();
    for (let n = 1; n <= AHEAD; n++) this.#ahead(k + n * this.way);
    this.#ahead(k - this.way);
  }

  #ahead(k) {
    if (k < 0 || k >= this.plane.count) return;
    this.grays.fetch(this.name, k);
    if (looked.kept) this.keeps.fetch(this.name, k);
    if (looked.geometry.labelled) this.maps.fetch(this.name, k);
  }

  #draw() {
    if (!this.plane || !this.canvas.clientWidth) return;
    const slice = this.grays.have(this.name, this.k);
    if (slice) this.#paint(slice);
    this.#mark();
    if (slice) Object.assign(this.canvas.dataset, { slice: this.k, lower: looked.window.lower[0] });
  }

  #paint(slice) {
    const [rows, columns] = this.plane.size;
    if (this.image?.width !== columns || this.image?.height !== rows) {
      this.image = new ImageData(columns, rows);
      this.drawn = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
    }
    slice.indices ??= this.indices(slice.values);
    const kept = looked.kept && !looked.moving ? this.keeps.have(this.name, this.k)?.values : null;
    const map = looked.geometry.labelled ? this.maps.have(this.name, this.k)?.values : null;
    const { roi, slice_range: range } = state.choices;
    const now = [slice, kept, map, this.tables(), String(roi), String(range)];
    if (now.every((one, n) => one === this.painted?.[n])) return;
    this.painted = now;
    const having = { indices: slice.indices, layers: looked.geometry.layers };
    const [out, outside] = [new Uint32Array(this.image.data.buffer), outsideOf(this.plane, this.k)];
    paint(out, having, state.choices.select && map ? null : kept || null, outside, this.tables());
    if (map) paintOver(out, { map, columns, kept, outside }, this.tables().over);
    this.drawn.getContext("2d", PAINTED).putImageData(this.image, 0, 0);
  }

  #mark() {
    const room = this.#room();
    const dots = devicePixelRatio;
    if (this.canvas.width !== Math.round(room.width * dots)) this.canvas.width = Math.round(room.width * dots);
    if (this.canvas.height !== Math.round(room.height * dots)) this.canvas.height = Math.round(room.height * dots);
    const pen = this.canvas.getContext("2d", PAINTED);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    pen.fillStyle = "#000";
    pen.fillRect(0, 0, room.width, room.height);
    const lie = this.#lie();
    if (this.drawn) this.#picture(pen, lie);
    const { rows, columns } = this.plane;
    const others = Object.entries(looked.geometry.planes);
    const line = (axis) => LINES[others.find(([, one]) => one.axis === axis)[0]];
    drawCross(pen, room, pointOf(lie, looked.at[rows] + 0.5, looked.at[columns] + 0.5), line(columns), line(rows));
    drawLetters(pen, room, this.plane, lie.flipped);
    drawScale(pen, room, lie.scale);
    if (this.drag?.kind === "box") drawBox(pen, this.drag.from, this.drag.to);
    this.#caption();
  }

  #picture(pen, { left, top, width, height, flipped }) {
    pen.imageSmoothingEnabled = !isLabels();
    pen.save();
    pen.translate(left, flipped ? top + height : top);
    pen.scale(1, flipped ? -1 : 1);
    pen.drawImage(this.drawn, 0, 0, width, height);
    pen.restore();
  }

  #caption() {
    const { name, plane, k, canvas } = this;
    const mm = inPatient(looked.at)[2 - plane.axis].toFixed(1);
    this.caption.textContent = `${name} ${k} of ${plane.count - 1}, ${"ZYX"[plane.axis]} ${mm} mm`;
    canvas.setAttribute("aria-valuemin", "0");
    canvas.setAttribute("aria-valuemax", String(plane.count - 1));
    canvas.setAttribute("aria-valuenow", String(k));
    canvas.setAttribute("aria-valuetext", this.caption.textContent);
  }
}
