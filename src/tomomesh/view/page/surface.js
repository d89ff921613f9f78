/** The surface: from points to mesh in steps, in 3-D, cut where a slice lies, and what was measured of it. */
import { get, numbers, post } from "./api.js";
import { el, fill, eachFrame } from "./dom.js";
import { choose, on, state, trying } from "./store.js";
import { problemList, reportTable } from "./report.js";
import { sliceWithOutline } from "./outline.js";

export const title = "Surface";
export const keys = [
  ["M", "make the surface"], ["[ and ]", "the step before, and after"], ["W, F", "edges; all of it (in the 3-D view)"],
  ["C", "cut at the slice"],
];
export const applies = (kind) => kind !== "nothing";

const NAMES = { points: "Points", cubes: "Cubes", cuberille: "Cuberille", triangulated: "Triangulated", smoothed: "Smoothed", fitted: "Fitted" };
const COLORS = { "": "none", distance: "distance to the points", thickness: "thickness", filled: "filled, not measured" };
const PLANES = ["axial", "coronal", "sagittal"];

/** @param {HTMLElement} panel */
export function mount(panel) {
  const part = new SurfacePart(panel);
  return { show: () => part.show(), hide: () => {}, key: (event) => part.key(event) };
}

class SurfacePart {
  constructor(panel) {
    this.stages = [];
    this.made = 0;
    this.viewer = null;
    this.ended = 0;
    this.build(panel);
    on("state", () => this.follow());
    on("progress", () => this.update());
    on("done", ({ name, job }) => {
      this.ended = job;
      if (name === "reconstruct") this.load();
      else if (this.waits) this.showStage();
    });
    for (const end of ["stopped", "failed"]) {
      on(end, ({ job }) => {
        this.ended = job;
        this.uncolor();
      });
    }
    on("theme", () => this.viewer?.setDark(isDark()));
    this.cut = eachFrame(() => this.cutNow());
  }

  build(panel) {
    panel.classList.add("surface");
    this.make = el("button", { type: "button", class: "first", onclick: () => this.begin() }, "Make the surface");
    this.hint = el("p", { class: "muted" });
    this.fault = el("div", { class: "fault", role: "alert" });
    this.step = el("input", { type: "range", min: 0, max: 0, step: 1, "aria-label": "Step", oninput: () => this.showStage() });
    this.steps = el("div", { class: "steps", "aria-hidden": "true" });
    this.color = el("select", { onchange: () => this.showStage() }, ...Object.entries(COLORS).map(([name, text]) => el("option", { value: name }, text)));
    this.wire = el("input", { type: "checkbox", onchange: () => this.viewer?.setWire(this.wire.checked) });
    this.plane = el("select", { onchange: () => this.cut() }, ...PLANES.map((name) => el("option", { value: name }, name)));
    this.slice = el("input", { type: "range", min: 0, max: 0, step: 1, "aria-label": "Slice of the cut", oninput: () => this.cut() });
    this.cuts = el("input", { type: "checkbox", onchange: () => this.cut() });
    this.beside = sliceWithOutline();
    this.told = el("div", { class: "told" });
    this.table = el("div", {});
    this.view = el("div", { class: "view" });
    this.empty = el("p", { class: "empty" }, "No surface yet.");
    const looks = el("div", { class: "row" }, el("label", {}, "Color ", this.color), el("label", {}, this.wire, " edges"));
    this.cutting = el("fieldset", {}, el("legend", {}, "Cut"), el("div", { class: "row" }, el("label", {}, this.cuts, " cut at the slice"), this.plane), this.slice, this.beside.element);
    const steps = el("fieldset", {}, el("legend", {}, "Step"), this.step, this.steps);
    this.shown = el("div", { class: "shown", hidden: true }, steps, looks);
    const side = el("div", { class: "side" }, this.make, this.fault, this.hint, this.shown, this.told, this.cutting, this.table);
    fill(panel, el("div", { class: "stage" }, this.view, this.empty), side);
  }

  show() {
    this.viewer?.redraw();
    this.update();
    if (!this.stages.length) this.load();
  }

  key(event) {
    const name = event.key.toLowerCase();
    if (name === "m" && !this.make.hidden && !this.make.disabled) this.begin();
    else if (name === "[" || name === "]") {
      this.step.value = Number(this.step.value) + (name === "]" ? 1 : -1);
      this.showStage();
    } else if (name === "c" && !this.cutting.hidden) {
      this.cuts.checked = !this.cuts.checked;
      this.cut();
    } else return false;
    return true;
  }

  begin() {
    trying(post("/api/reconstruct"));
  }

  /** Follow what is opened: a mesh is shown as soon as it has been read. */
  follow() {
    const { turn, ready } = state.opened;
    if (turn !== this.turn) {
      this.turn = turn;
      this.clear();
      if (ready && state.opened.kind !== "study") this.load();
    }
    this.update();
  }

  update() {
    const { opened, made, job } = state;
    this.make.hidden = isMesh(opened);
    this.make.disabled = Boolean(job) || !opened.ready;
    this.make.textContent = "reconstruct" in made ? "Make it again" : "Make the surface";
    const stale = made.reconstruct === false;
    this.hint.textContent = this.waits ? "Measuring what is to color it ..." : stale ? "Choices have changed since this surface was made." : this.size || "";
    this.tellFault();
    this.shown.hidden = !this.stages.length;
    this.cutting.hidden = opened.kind !== "study" || !this.stages.length;
    if (!this.stages.length) this.empty.textContent = opened.refused || (opened.ready ? "No surface yet." : "Reading ...");
    if (!("reconstruct" in made) && opened.kind === "study" && this.stages.length) this.clear();
  }

  /** Say what the last surface failed by, and offer what its line names. */
  tellFault() {
    const failed = state.failed?.name === "reconstruct" ? state.failed : null;
    if ((failed?.error ?? "") === (this.fault.dataset.error ?? "")) return;
    this.fault.dataset.error = failed?.error ?? "";
    const anew = (flag) => choose({ [flag.replace(/^--(no-)?/, "").replaceAll("-", "_")]: !flag.startsWith("--no-") }).then(() => this.begin());
    const helps = (failed?.flags ?? []).map((flag) => el("button", { type: "button", onclick: () => anew(flag) }, `Make it with ${flag}`));
    const places = (failed?.places ?? []).map(([place, radius]) => el("button", { type: "button", onclick: () => this.viewer?.fly(place, radius) }, "Show where"));
    fill(this.fault, failed && el("p", {}, failed.error), ...places, ...helps);
  }

  clear() {
    this.stages = [];
    this.viewer?.dispose();
    this.viewer = null;
    this.empty.hidden = false;
    fill(this.told);
    fill(this.table);
    fill(this.steps);
    this.size = "";
  }

  async load() {
    const measured = state && ("reconstruct" in state.made || isMesh(state.opened));
    const known = measured || state?.opened.kind === "points";
    const found = known && state.opened.ready && (await trying(get("/api/stages")));
    if (!found) return;
    this.stages = found.stages;
    for (const option of this.color.options) option.hidden = isMesh(state.opened) && ["distance", "filled"].includes(option.value);
    this.update();
    this.step.max = this.stages.length - 1;
    this.step.value = this.step.max;
    fill(this.steps, ...this.stages.map(({ name }) => el("span", {}, NAMES[name])));
    fill(this.told, measured && el("p", { class: "muted" }, "Measuring ..."));
    if (state.opened.kind === "study") this.planes = (await trying(get("/api/planes")))?.planes;
    await this.showStage();
    if (measured) await this.loadReport();
  }

  /** After what is drawn: a large mesh is seen before it is measured. */
  async loadReport() {
    const found = await trying(get("/api/report"));
    if (!found) return;
    fill(this.told, ...problemList(found.verdict, found.problems, (place, radius) => this.viewer?.fly(place, radius)));
    fill(this.table, reportTable(found.report));
  }

  async showStage() {
    const stage = this.stages[Number(this.step.value)];
    if (!stage) return;
    for (const [n, span] of [...this.steps.children].entries()) span.classList.toggle("now", n === Number(this.step.value));
    const asked = (this.made += 1);
    const color = stage.name === "fitted" ? await this.measured() : "";
    const answer = await trying(fetch(`/mesh/${stage.name}?color=${color}`).then(bytesOf));
    if (!answer || asked !== this.made) return;
    this.empty.hidden = true;
    this.viewer ||= window.tomomeshViewer?.createViewer(this.view, { dark: isDark(), wheel: "always" });
    if (!this.viewer) {
      this.empty.hidden = false;
      this.empty.textContent = "This browser draws nothing in 3-D (no WebGL). The report and the files are there all the same.";
      return;
    }
    const scene = window.tomomeshViewer.decodeScene(answer);
    this.viewer.show(scene, { keep: true });
    const told = scene.header.values[0];
    this.viewer.setColors(told ? scene.values[told.name] : null, told);
    this.viewer.setWire(this.wire.checked);
    this.tellSize(stage, scene);
    this.cut();
  }

  /** What is to color the mesh, once it is measured: until then nothing. */
  async measured() {
    const color = this.color.value;
    const found = color && (await trying(post("/api/color", { color })));
    if (found?.job <= this.ended) return this.measured(); // its end was told before it was
    this.waits = Boolean(found && !found.ready);
    this.update();
    return found?.ready ? color : "";
  }

  /** What was to be measured is not. */
  uncolor() {
    if (this.waits) this.color.value = "";
    this.waits = false;
    this.update();
  }

  tellSize(stage, scene) {
    const unit = { points: "points", cubes: "cubes", cuberille: "squares" }[stage.name] ?? "triangles";
    const [all, drawn] = stage.name === "points" ? [stage.faces, scene.header.vertices] : [scene.header.of_faces, scene.header.faces];
    const fewer = all > drawn ? `, drawn as ${drawn.toLocaleString("en")}` : "";
    this.view.setAttribute("aria-label", `${NAMES[stage.name]}: ${stage.faces} ${unit}`);
    this.size = `${stage.faces.toLocaleString("en")} ${unit}${fewer}`;
    this.update();
  }

  async cutNow() {
    if (!this.viewer || this.cutting.hidden || !this.planes) return;
    const plane = this.plane.value;
    const last = this.planes[plane].count - 1;
    if (Number(this.slice.max) !== last) {
      this.slice.max = last;
      this.slice.value = Math.round(last / 2);
    }
    const k = Number(this.slice.value);
    const outline = await trying(numbers(`/outline/${plane}/${k}`));
    if (!outline || k !== Number(this.slice.value)) return;
    this.beside.show(plane, k, outline.values, this.planes[plane]);
    const at = await trying(get(`/api/place/${plane}/${k}`));
    if (at) this.viewer.clip(this.cuts.checked ? at : null);
  }
}

async function bytesOf(answer) {
  if (answer.ok) return answer.arrayBuffer();
  throw new Error((await answer.json()).error);
}

/** Whether what is opened is a mesh, alone or in the folder of its run. */
function isMesh({ kind }) {
  return kind === "mesh" || kind === "run";
}

function isDark() {
  const asked = document.documentElement.dataset.theme;
  return asked === "dark" || (asked !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
}
