/** The window: suggestions, numbers, and what is kept of it; and apart from it, how gray levels are drawn. */
import { el, fill, short } from "./dom.js";
import { look, looked, unit } from "./looked.js";
import { choose, on, state } from "./store.js";

const NAMES = ["lower", "upper"];
const KEEP = { auto: "body or all (auto)", body: "the body", largest: "the largest", all: "all, specks too" };
/** Contrasts that radiologists read CT with: width and level. */
const CONTRASTS = { "soft tissue": [400, 40], bone: [2000, 500], lung: [1500, -600], brain: [80, 40] };

/** The lower (0) or upper (1) bounds, one a layer. @param {number} n @returns {number[]} */
export const boundsOf = (n) => looked.window[NAMES[n]];

/** Choose the bounds as they are drawn. */
export function chooseBounds() {
  looked.held = false;
  const { lower, upper } = looked.window;
  const none = lower.every((one) => one === -Infinity) && upper.every((one) => one === Infinity);
  const { lowest, highest } = looked.survey ?? looked.geometry; // which may be typed before the study is surveyed
  const below = Math.floor(lowest) - 1;
  const above = Math.ceil(highest);
  choose({
    preset: null, select: null,
    lower: none ? below : sent(lower, -Infinity, below),
    upper: sent(upper, Infinity, above),
  });
}

function sent(bounds, none, far) {
  if (bounds.every((one) => one === none)) return null;
  const finite = bounds.map((one) => (one === none ? far : one));
  return finite.every((one) => one === finite[0]) ? finite[0] : finite;
}

/** Take the bounds from what was kept, else from what was chosen, else from what is suggested; not while a hand holds them. */
export function settleWindow() {
  if (looked.held) return;
  const { choices } = state;
  const layers = looked.geometry?.layers || 1;
  const suggested = looked.survey?.windows[choices.preset || "otsu"] || {};
  const given = "lower" in choices || "upper" in choices;
  const found = looked.kept?.window || (given ? choices : suggested);
  const spread = (value, none) => (Array.isArray(value) ? value.map((one) => one ?? none) : Array(layers).fill(value ?? none));
  looked.window = choices.select ? { lower: Array(layers).fill(Infinity), upper: Array(layers).fill(Infinity) }
    : { lower: spread(found.lower, -Infinity), upper: spread(found.upper, Infinity) };
}

/** Draw the levels of a first slice from black to white; soft tissue of what is a CT. @param {any} values */
export function settleContrast(values) {
  if (looked.geometry.unit === "HU") return setContrast(...CONTRASTS["soft tissue"]);
  const some = Float64Array.from({ length: 4096 }, (_, n) => values[Math.floor((n * values.length) / 4096)]).sort();
  const [low, high] = [some[8], some[4087]];
  return setContrast(high - low || 1, (low + high) / 2);
}

function setContrast(width, center) {
  looked.contrast = { center, width };
  look();
}

/** The section of the panel. @returns {{element: HTMLElement, show: () => void}} */
export function makeWindowing() {
  const suggestions = el("div", { class: "chips", role: "group", "aria-label": "Suggested windows" });
  const numbers = NAMES.map((name) => el("input", { type: "number", step: "any", placeholder: "no limit", "aria-label": `${name} bound`, onchange: () => typed(numbers) }));
  const keep = chooser("keep", KEEP, "What is kept of the window");
  const joined = chooser("layers", { all: "in all layers", any: "in any layer" }, "In how many layers a voxel lies in the window");
  const layer = el("select", { "aria-label": "Layer whose bounds are moved", onchange: () => { looked.layer = Number(layer.value); look(); show(); } });
  const units = el("span", {});
  const element = el("section", { class: "part for-gray" }, el("h2", {}, "Window"), suggestions,
    el("div", { class: "fields" }, "over", numbers[0], "up to", numbers[1], units),
    el("div", { class: "fields" }, layer, joined, el("label", {}, "keep ", keep)));
  const showNumbers = () => numbers.forEach((input, n) => {
    const level = boundsOf(n)[looked.layer];
    if (document.activeElement !== input) input.value = Number.isFinite(level) ? short(level, 5) : "";
  });
  const show = () => {
    fill(suggestions, ...suggested());
    units.textContent = looked.geometry?.unit === "HU" ? "HU" : "";
    keep.value = state.choices.keep || "auto";
    joined.value = state.choices.layers || "all";
    const layers = looked.geometry?.layers || 1;
    joined.hidden = layer.hidden = layers === 1;
    if (layer.options.length !== layers) fill(layer, ...["red", "green", "blue", "fourth"].slice(0, layers).map((name, n) => el("option", { value: n }, name)));
    showNumbers();
  };
  on("window", showNumbers);
  return { element, show };
}

function chooser(name, options, label) {
  const select = el("select", { "aria-label": label, title: label, onchange: () => choose({ [name]: select.value }) });
  fill(select, ...Object.entries(options).map(([value, text]) => el("option", { value }, text)));
  return select;
}

function typed(numbers) {
  numbers.forEach((input, n) => { boundsOf(n)[looked.layer] = input.value === "" ? [-Infinity, Infinity][n] : Number(input.value); });
  chooseBounds();
}

function suggested() {
  const { choices } = state;
  return Object.entries(looked.survey?.windows || {}).map(([name, window]) => {
    const [changes, pressed] = asked(name, window, choices);
    const bounds = `over ${said(window.lower)}${window.upper === null ? "" : ` up to ${said(window.upper)}`}${unit()}`;
    const share = `${(100 * window.share).toFixed(window.share < 0.1 ? 1 : 0)} %`;
    const cut = window.cut_off_at.length ? `; cut off at ${window.cut_off_at.join(", ")}` : "";
    return el("button", { type: "button", "aria-pressed": String(pressed), title: `${bounds}: ${share} of the voxels${cut}`, onclick: () => choose(changes) },
      name, " ", el("small", {}, share));
  });
}

function asked(name, window, choices) {
  const none = { lower: null, upper: null, preset: null, select: null };
  if (name === "otsu") return [none, !["lower", "upper", "preset", "select"].some((one) => one in choices)];
  if (name.startsWith("otsu")) return [{ ...none, lower: window.lower }, choices.lower === window.lower && !("upper" in choices)];
  return [{ ...none, preset: name }, choices.preset === name];
}

const said = (limit) => (Array.isArray(limit) ? limit.map((one) => said(one)).join(", ") : limit === null ? "all" : short(limit, 5));

/** How gray levels are drawn, which changes nothing of what is kept. @returns {{element: HTMLElement, show: () => void}} */
export function makeContrast() {
  const names = el("select", { "aria-label": "Contrast", onchange: () => named(names.value) });
  const fields = ["width", "center"].map((name) => el("input", { type: "number", step: "any", "aria-label": `contrast, ${name}`, onchange: () => setContrast(Math.max(Number(fields[0].value), 1e-6), Number(fields[1].value)) }));
  const opacity = el("input", { type: "range", min: 0, max: 1, step: 0.05, value: looked.opacity, "aria-label": "Opacity of what is kept", oninput: () => { looked.opacity = Number(opacity.value); look(); } });
  const element = el("section", { class: "part" }, el("h2", {}, "Display"),
    el("div", { class: "fields for-gray", title: "Drag with the right button on a slice: sideways the width, up and down the level" }, names, el("label", {}, "W ", fields[0]), el("label", {}, "L ", fields[1])),
    el("div", { class: "fields" }, el("label", {}, "color over gray ", opacity)));
  const show = () => {
    const known = looked.geometry?.unit === "HU" ? Object.keys(CONTRASTS) : [];
    if (names.options.length !== known.length + 3) fill(names, ...["contrast", ...known, "window", "all levels"].map((name) => el("option", { value: name }, name)));
    if (!fields.includes(document.activeElement)) [looked.contrast.width, looked.contrast.center].forEach((value, n) => { fields[n].value = short(value, 4); });
  };
  on("look", show);
  return { element, show };
}

function named(name) {
  const { histogram_from: from = 0, histogram_to: to = 1 } = looked.survey || {};
  const ends = { "all levels": [from, to], window: [0, 1].map((n) => Math.min(Math.max(boundsOf(n)[looked.layer], from), to)) }[name];
  if (ends) setContrast(ends[1] - ends[0] || 1, (ends[0] + ends[1]) / 2);
  else if (CONTRASTS[name]) setContrast(...CONTRASTS[name]);
}
