/** The elements of the part for networks. */
import { el, fill } from "./dom.js";

const LAYERS = { image: "Image", window: "Window", inputs: "Inputs", regions: "Regions", network: "Network" };

/**
 * Lay out the panel.
 * @param {HTMLElement} panel
 * @param {[number, string][]} speeds
 */
export function layOut(panel, speeds) {
  const at = { ...side(), ...stage(speeds), ...beside() };
  const trains = el("div", { class: "net-buttons" }, at.train, at.all);
  const left = el("aside", { class: "net-side", "aria-label": "What is trained" },
    el("h2", {}, "The paper's figures"), at.figures,
    el("h2", {}, "Train"), at.sourceRow, at.sliceRow, trains,
    el("h2", {}, "With"), at.options, el("div", { class: "net-buttons" }, at.paper, at.defaults));
  const middle = el("div", { class: "net-stage" }, el("div", { class: "net-head" }, at.title, at.step), el("div", { class: "net-view" }, at.canvas, at.relief), at.player, at.layersRow, at.caption);
  const right = el("aside", { class: "net-beside", "aria-label": "Course of the training" }, at.curves, at.maps, at.saving);
  panel.classList.add("net");
  fill(panel, left, middle, right);
  return Object.assign(at, { fill: (told, play) => filled(at, told, play), sliced: () => sliced(at) });
}

function side() {
  const source = el("select", { id: "net-source" });
  const slice = el("input", { id: "net-slice", type: "range", min: 0, max: 0, step: 1 });
  const sliceNumber = el("output", { for: "net-slice" });
  return {
    figures: el("div", { class: "net-figures", role: "group", "aria-label": "Figures of the paper" }), source, slice, sliceNumber, study: false,
    sourceRow: el("div", { class: "net-row" }, el("label", { for: "net-source" }, "On"), source),
    sliceRow: el("div", { class: "net-row" }, el("label", { for: "net-slice" }, "Slice"), slice, sliceNumber),
    train: el("button", { id: "net-train", type: "button", class: "first", title: "T" }, "Train"), all: el("button", { id: "net-all", type: "button" }, "All slices"),
    options: el("form", { class: "net-options", onsubmit: (event) => event.preventDefault() }),
    paper: el("button", { id: "net-paper", type: "button", title: "All parameters by the paper (--way paper)" }, "Reset to the paper"),
    defaults: el("button", { id: "net-defaults", type: "button", title: "All of these by tomomesh's own defaults" }, "Defaults"),
  };
}

function stage(speeds) {
  const layers = Object.fromEntries(Object.keys(LAYERS).map((name) => [name, el("input", { type: "checkbox", id: `net-layer-${name}`, checked: name !== "regions" })]));
  const rows = Object.entries(layers).map(([name, box]) => el("label", { for: box.id }, box, LAYERS[name]));
  const frames = el("input", { id: "net-frames", type: "range", min: 0, max: 0, step: 1, "aria-label": "Epoch" });
  const speed = el("select", { id: "net-speed", "aria-label": "Epochs a second" }, ...speeds.map(([value, name]) => el("option", { value }, name)));
  speed.value = "10";
  const [back, toggle, forth] = [["net-back", "◀ Step"], ["net-toggle", "Play"], ["net-forth", "Step ▶"]].map(([id, name]) => el("button", { id, type: "button" }, name));
  const step = el("output", { id: "net-step", class: "net-step" });
  return {
    title: el("h1", { class: "net-title", id: "net-title" }), layers, layersRow: el("div", { class: "net-layers", role: "group", "aria-label": "What is drawn" }, ...rows),
    canvas: el("canvas", { id: "net-canvas", class: "net-canvas", tabindex: 0, role: "img", "aria-labelledby": "net-title" }),
    relief: el("img", { id: "net-relief", class: "net-canvas", alt: "A slice as a landscape of its gray levels", hidden: true }),
    frames, speed, back, toggle, forth, step,
    player: el("div", { id: "net-player", class: "net-player" }, back, toggle, forth, frames, speed),
    caption: el("p", { id: "net-caption", class: "net-caption", "aria-live": "polite" }),
  };
}

function beside() {
  const link = (href, name) => el("a", { href, download: true, class: "net-link" }, name);
  return {
    curves: el("div", { class: "net-curves" }, el("p", { class: "net-hint" }, "Error, radius and alpha of a training are drawn here.")), maps: el("div", { class: "net-maps" }),
    saving: el("div", { class: "net-buttons", hidden: true }, link("/training.gif", "Save GIF"), link("/training.toml", "Save settings.toml")),
  };
}

/** Fill in what depends on what is opened. */
function filled(at, told, play) {
  const study = Boolean(told.study);
  if (!at.figures.children.length) fill(at.figures, ...told.figures.map((figure) => el("button", { type: "button", title: `${figure.title}. ${figure.caption}`, onclick: () => play(figure) }, figure.name)));
  if (!at.source.options.length || at.study !== study) sources(at, told, study);
  at.study = study;
  const here = study && at.source.value === "slice";
  at.sliceRow.hidden = !here || told.space;
  at.all.hidden = !study;
  at.train.textContent = !here ? "Train" : told.space ? "Train in space" : "Train this slice";
  const most = Math.max(study ? told.study.slices - 1 : 0, 0);
  if (Number(at.slice.max) !== most) Object.assign(at.slice, { max: String(most), value: String(Math.floor(most / 2)) });
  sliced(at);
}

/** Say which slice it is. */
function sliced(at) {
  at.sliceNumber.textContent = `${at.slice.value} of 0 to ${at.slice.max}`;
}

function sources(at, told, study) {
  const names = { input: "a single input", head: "a slice of the built-in head" };
  const own = study ? [el("option", { value: "slice" }, "the study")] : [];
  fill(at.source, ...own, ...told.regions.map((name) => el("option", { value: name }, names[name] || `a ${name}`)));
  at.source.value = study ? "slice" : "triangle";
}
