/** Networks: one is trained while a class looks on; those of all slices; the paper's figures; what is saved. */
import { get, numbers, post } from "./api.js";
import { eachFrame } from "./dom.js";
import { draw } from "./network-canvas.js";
import { sliceOf } from "./network-backdrop.js";
import { courseOf } from "./network-course.js";
import { layOut } from "./network-layout.js";
import { fillOptions, parametersOf } from "./network-options.js";
import { player, SPEEDS } from "./network-player.js";
import { showSide } from "./network-side.js";
import { EMPTY, ofSlice } from "./network-words.js";
import { choose, on, state, trying } from "./store.js";

export const title = "Networks";
export const keys = [
  ["Space", "play or pause"], ["Left, Right", "one epoch back or forth"], ["Home, End", "the start, the last epoch"],
  ["Up, Down", "the slice above or below"], ["T", "train"],
];
export const applies = (kind) => kind === "study" || kind === "nothing";

/** @param {HTMLElement} panel */
export function mount(panel) {
  const part = new Part(layOut(panel, SPEEDS));
  return { show: () => part.show(), hide: () => part.hide(), key: (event) => part.key(event) };
}

class Part {
  constructor(at) {
    this.at = at;
    this.seen = false;
    this.told = null;
    this.parameters = null;
    this.figure = null;
    this.slice = null;
    this.networks = null;
    this.mode = "course";
    this.camera = { turn: 0.6, tilt: 0.45 };
    this.play = player((frame) => this.showFrame(frame));
    this.course = courseOf((course) => this.play.have(course.have, course.ended), () => this.begun());
    this.redraw = eachFrame(() => this.draw());
    this.wire();
  }

  wire() {
    const { at } = this;
    at.train.onclick = () => this.train();
    at.all.onclick = () => this.trainAll();
    at.paper.onclick = () => this.reset({ way: "paper" });
    at.defaults.onclick = () => this.reset({});
    at.source.onchange = () => this.sourced();
    at.slice.oninput = () => this.showSlice();
    at.toggle.onclick = () => this.play.toggle();
    at.back.onclick = () => this.play.step(-1);
    at.forth.onclick = () => this.play.step(1);
    at.frames.oninput = () => this.play.seek(Number(at.frames.value));
    at.speed.onchange = () => this.play.speed(Number(at.speed.value));
    for (const box of Object.values(at.layers)) box.onchange = this.redraw;
    at.canvas.onpointermove = (event) => this.turn(event);
    new ResizeObserver(this.redraw).observe(at.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", this.redraw);
    on("theme", this.redraw);
    on("state", () => this.seen && this.refresh());
    on("progress", () => this.working());
    on("training", (told) => this.course.begin(told));
    on("epoch", (frame) => this.course.add(frame));
    for (const end of ["done", "stopped", "failed"]) on(end, (job) => this.finished(end, job));
    this.working();
  }

  async show() {
    this.seen = true;
    if (!this.parameters) this.parameters = parametersOf(await get("/api/schema"));
    await this.refresh();
    if (!this.course.now) await this.course.restore();
    this.captioned();
    this.redraw();
  }

  hide() {
    this.seen = false;
  }

  get region() {
    return this.at.source.value === "slice" ? "" : this.at.source.value;
  }

  /** Ask what can be chosen now, and show it. */
  async refresh() {
    const told = await trying(get("/api/networks", this.region ? { region: this.region } : {}));
    if (!told || !this.parameters) return;
    this.told = told;
    const before = this.region;
    this.at.fill(told, (figure) => this.playFigure(figure));
    if (this.region !== before) return this.refresh();
    fillOptions(this.at.options, this.parameters, told.options);
    this.working();
    this.captioned();
    const first = !this.slice && !this.course.now;
    if (told.study && told.study.slices && !this.region && (first || (this.mode === "slices" && this.chosen !== choices()))) await this.showSlice();
  }

  working() {
    const busy = Boolean(state && state.job) || !this.told;
    this.at.train.disabled = this.at.all.disabled = busy || (!this.region && !(this.told.study && this.told.study.slices));
  }

  sourced() {
    this.figure = null;
    this.mode = this.region ? "course" : "slices";
    if (!this.region) this.showSlice();
    this.refresh();
  }

  reset(changes) {
    const every = Object.fromEntries([...this.told.options, "way"].map((name) => [name, null]));
    return choose({ ...every, ...changes });
  }

  async train() {
    if (this.at.train.disabled) return;
    this.at.train.disabled = true;
    const asked = this.region ? { region: this.region } : this.told.space ? { space: true } : { slice: Number(this.at.slice.value) };
    this.at.canvas.focus();
    if (!(await trying(post("/api/train", asked)))) this.working();
  }

  async trainAll() {
    this.at.all.disabled = true;
    if (!(await trying(post("/api/segment")))) this.working();
  }

  /** Choose what a figure is made with, and train or show it. */
  async playFigure(figure) {
    const own = figure.own && this.told.study && this.told.study.slices > 0;
    this.at.source.value = own ? "slice" : figure.region;
    if (Object.keys(figure.choices).length && !(await choose(figure.choices))) return;
    await this.refresh();
    this.at.layers.regions.checked = figure.shows === "regions";
    if (figure.shows === "network" || figure.shows === "regions") await this.train();
    else await this.showStill(figure, own);
    this.figure = figure;
    this.captioned();
  }

  async showStill(figure, own) {
    const k = own ? { k: Number(this.at.slice.value) } : {};
    this.play.leave();
    this.mode = figure.shows;
    this.networks = null;
    if (figure.shows === "relief") this.at.relief.src = `/picture/relief?${new URLSearchParams(k)}`;
    else await this.fetchSlice({ of: own ? "study" : "head", ...k });
    this.redraw();
  }

  /** Show a slice of the study, and its networks where all slices are trained. */
  async showSlice() {
    const k = Number(this.at.slice.value);
    this.figure = null;
    this.play.leave();
    this.mode = "slices";
    this.chosen = choices();
    this.at.sliced();
    const waiting = setTimeout(() => (this.at.caption.textContent = "Finding what is kept of the study ..."), 400);
    await this.fetchSlice({ of: "study", k });
    clearTimeout(waiting);
    if (Number(this.at.slice.value) !== k) return;
    this.networks = this.told.segmented ? await trying(get(`/api/networks/${k}`)) : null;
    this.captioned();
    this.redraw();
  }

  async fetchSlice(query) {
    if (this.asking) this.asking.abort();
    this.asking = new AbortController();
    const found = await trying(numbers("/training/picture", query, this.asking.signal));
    if (found) this.slice = sliceOf(found);
  }

  /** A training has begun: show it from its start. */
  begun() {
    this.mode = "course";
    this.networks = null;
    if (this.figure && this.figure.region !== this.course.now.source.region && !this.figure.own) this.figure = null;
    this.play.begin();
    this.captioned();
  }

  async finished(end, job) {
    if (job.name === "train") await this.course.finish();
    if (job.name === "segment" && end === "done") {
      await this.refresh();
      await this.showSlice();
    }
    this.working();
  }

  showFrame(frame) {
    if (this.mode !== "course") this.figure = null;
    this.mode = "course";
    this.captioned();
    this.redraw();
  }

  turn(event) {
    if (!event.buttons || !this.course.now || this.course.now.dimensions !== 3) return;
    this.camera.turn += event.movementX / 120;
    this.camera.tilt = Math.max(-1.5, Math.min(1.5, this.camera.tilt + event.movementY / 120));
    this.redraw();
  }

  draw() {
    if (!this.seen) return;
    const { at, course } = this;
    at.relief.hidden = this.mode !== "relief";
    at.canvas.hidden = this.mode === "relief";
    for (const name of ["image", "window"]) at.layers[name].parentElement.hidden = this.mode === "course" && !course.slice;
    at.layersRow.hidden = this.mode === "relief";
    const layers = Object.fromEntries(Object.entries(at.layers).map(([name, box]) => [name, box.checked]));
    const now = this.mode === "course" ? course.now : null;
    if (now) draw(at.canvas, { course: now, frame: now.frames[this.play.at], before: now.frames[this.play.at - 1], inputs: course.inputs, slice: course.slice, layers, camera: this.camera });
    else if (this.mode !== "relief" && this.slice) draw(at.canvas, { slice: this.slice, networks: this.networks && this.networks.networks, layers, camera: this.camera });
    showSide(at, now, this.play, Boolean(course.now));
  }

  captioned() {
    const { course, figure, mode, networks } = this;
    for (const one of this.at.figures.children) one.setAttribute("aria-pressed", String(Boolean(figure) && one.textContent === figure.name));
    const still = () => (this.told && this.told.study && this.told.study.fault) || ofSlice(networks, this.at.slice.value);
    const words = figure ? `${/^\d/.test(figure.name) ? `Fig. ${figure.name}. ` : ""}${figure.caption}` : mode === "course" ? course.now && course.now.note : still();
    this.at.caption.textContent = words || (course.now || this.slice ? "" : EMPTY);
  }

  key(event) {
    const held = event.target.closest("button, input, select");
    if (held && (event.key === " " || held.type === "range" || held.type === "checkbox")) return false;
    const does = { " ": () => this.play.toggle(), ArrowLeft: () => this.play.step(-1), ArrowRight: () => this.play.step(1), Home: () => this.play.seek(0), End: () => this.play.seek(Infinity), ArrowUp: () => this.stepSlice(1), ArrowDown: () => this.stepSlice(-1), t: () => this.train(), T: () => this.train() }[event.key];
    if (does) does();
    return Boolean(does);
  }

  stepSlice(by) {
    if (this.region || !this.told || !this.told.study) return;
    this.at.slice.value = String(Number(this.at.slice.value) + by);
    this.showSlice();
  }
}

const choices = () => JSON.stringify(state.choices);
