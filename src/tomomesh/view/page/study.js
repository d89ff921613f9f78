/** Study: three planes, the histogram and its window, what is kept; or what may be opened, and why it was refused. */
import { get } from "./api.js";
import { el, eachFrame } from "./dom.js";
import { Slices } from "./fetching.js";
import { makeHistogram } from "./histogram.js";
import { makeKeeping, pickComponent, pickLabel } from "./keeping.js";
import { goTo, isLabels, look, looked } from "./looked.js";
import { makeOpening } from "./opening.js";
import { labelsOf, mixOf, scaleOf, tonesOf } from "./painting.js";
import { Plane } from "./plane.js";
import { chooseBox, makeRegion } from "./region.js";
import { on, pick, state, tell, trying } from "./store.js";
import { makeContrast, makeWindowing, settleContrast, settleWindow } from "./windowing.js";

export const title = "Study";
export const keys = [
  ["Up, Down, wheel", "the next slice, the one before"], ["Page Up, Page Down", "ten slices on, back"], ["Home, End", "the first, the last slice"],
  ["A, S, Q", "the axial, the sagittal, the coronal plane"], ["Shift + arrows", "the crosshair by a pixel"], ["M", "the plane larger, or all three"],
  ["+, -, Ctrl + wheel", "zoom; drag with the middle button"], ["C, P, B", "what a click does: crosshair, pick, box"], ["Enter", "pick what is under the crosshair; Box: one corner, then the other"],
  ["right button", "contrast: sideways the width, up and down the level"],
];
export const applies = (kind, opened) => kind === "study" || kind === "nothing" || opened.browses || (kind === "run" && !opened.ready);

const TOOLS = { cross: "Crosshair (C)", pick: "Pick (P)", box: "Box (B)" };
const HELD = 72;
const grays = new Slices("/slice", HELD);
const keeps = new Slices("/kept", HELD);
const maps = new Slices("/labels", HELD);
let scale = null;
let made = null;

/** The tables that lead from levels to colors: made once for all planes where something has changed. */
function tables() {
  if (made) return made;
  const { contrast, window, opacity } = looked;
  const labels = isLabels() ? labelsOf(scale, new Set(state.choices.select || [])) : null;
  const tones = window.lower.map((lower, n) => tonesOf(scale, contrast, lower, window.upper[n]));
  const over = looked.geometry.labelled ? { chosen: new Set(state.choices.select || []), opacity } : null;
  made = { tones, labels, over, mix: mixing(opacity), any: state.choices.layers === "any" };
  return made;
}

let mixed = { opacity: -1, mix: null };
function mixing(opacity) {
  if (mixed.opacity !== opacity) mixed = { opacity, mix: mixOf(opacity) };
  return mixed.mix;
}

function indices(values) {
  scale ??= scaleOf(values, looked.geometry);
  return scale.indices(values);
}

/** @param {HTMLElement} panel */
export function mount(panel) {
  on("look", () => { made = null; });
  const parts = { windowing: makeWindowing(), keeping: makeKeeping(), region: makeRegion(), contrast: makeContrast() };
  const opening = makeOpening();
  const { views, planes, showOpening } = makeViews(parts.keeping.say);
  const side = el("aside", { class: "side" }, ...Object.values(parts).map((one) => one.element));
  const study = el("div", { class: "study", hidden: true }, views, side);
  panel.append(study, opening.element);
  const page = { study, opening, planes, parts, showOpening, turn: -1, choices: "", listing: false };
  showOpening.onclick = () => { page.listing = !page.listing; showAll(page); };
  on("state", () => follow(page));
  if (state) follow(page);
  const redraw = eachFrame(look);
  return { show: redraw, hide() {}, key: (event) => onKey(event, page) };
}

function makeViews(say) {
  const views = el("div", { class: "views" });
  const largest = (name) => { views.dataset.large = views.dataset.large === name ? "" : name; look(); };
  const pick = (place) => pickAt(place, say);
  const planes = Object.fromEntries(["axial", "sagittal", "coronal"].map((name) => [name, new Plane(name, { grays, keeps, maps, tables, indices, pick, largest })]));
  const under = el("span", { class: "under", "aria-live": "off" });
  const showOpening = el("button", { type: "button", title: "Other series and files" }, "Open ...");
  on("under", ({ line }) => { under.textContent = line; });
  const bar = el("div", { class: "tools" }, ...makeTools(), under, showOpening);
  views.append(bar, ...Object.values(planes).map((one) => one.element), makeHistogram().element);
  return { views, planes, showOpening };
}

function makeTools() {
  const buttons = Object.entries(TOOLS).map(([tool, name]) => el("button", { type: "button", "aria-pressed": String(tool === looked.tool), onclick: () => useTool(tool) }, name));
  on("tool", () => buttons.forEach((one, n) => one.setAttribute("aria-pressed", String(Object.keys(TOOLS)[n] === looked.tool))));
  return buttons;
}

function useTool(tool) {
  looked.tool = tool;
  tell("tool");
}

function pickAt(place, say) {
  const { planes } = looked.geometry;
  const [name, plane] = Object.entries(planes).find(([other, one]) => grays.have(other, place[one.axis])) || [];
  if (!name || place.some((n, axis) => n < 0 || n >= looked.geometry.shape[axis])) return;
  const at = place[plane.rows] * plane.size[1] + place[plane.columns];
  const { layers } = looked.geometry;
  const levels = grays.have(name, place[plane.axis]).values.subarray(at * layers, (at + 1) * layers);
  if (isLabels()) return pickLabel(Math.round(levels[0]));
  if (looked.geometry.labelled) return pick(place);
  const within = [...levels].map((level, n) => level > looked.window.lower[n] && level <= looked.window.upper[n]);
  const held = state.choices.layers === "any" ? within.some(Boolean) : within.every(Boolean);
  if (looked.kept) pickComponent(place, Boolean(keeps.have(name, place[plane.axis])?.values[at]), held, say);
}

/** Follow the session: fetch what has changed of what is opened and of what is kept. */
async function follow(page) {
  if (page.turn !== state.opened.turn) return opened(page);
  const choices = JSON.stringify(state.choices);
  if (choices === page.choices && !looked.moving) return undefined;
  page.choices = choices;
  if (looked.geometry) await keep(page);
  return undefined;
}

async function opened(page) {
  page.turn = state.opened.turn;
  page.choices = JSON.stringify(state.choices);
  Object.assign(looked, { geometry: null, survey: null, kept: null, layer: 0, moving: false, held: false });
  scale = null;
  grays.restart();
  keeps.restart();
  maps.restart();
  if (state.opened.kind === "study" && state.opened.ready) await begin(page);
  else showAll(page);
}

async function begin(page) {
  const { turn } = page;
  looked.geometry = await trying(get("/api/planes"));
  if (turn !== page.turn || !looked.geometry) return;
  page.listing = false;
  const { count } = looked.geometry.planes.axial;
  const middle = await grays.fetch("axial", count >> 1);
  if (turn !== page.turn || !middle) return;
  indices(middle.values);
  settleContrast(middle.values);
  settleWindow();
  showAll(page);
  goTo(looked.geometry.shape.map((size) => size >> 1));
  const kept = keep(page);
  const survey = await trying(get("/api/study"));
  if (turn !== page.turn) return;
  looked.survey = survey;
  if (!looked.kept) settleWindow();
  showAll(page);
  if (isLabels() && !state.choices.select) await keep(page);
  await kept;
}

/** Ask what is kept now; an answer that others have overtaken is not shown. */
async function keep(page) {
  const asked = page.choices;
  page.abort?.abort();
  page.abort = new AbortController();
  looked.kept = null;
  settleWindow();
  looked.moving = true;
  showAll(page);
  if (isLabels() && !state.choices.select) return page.parts.keeping.say("Choose labels here, or with the tool Pick in a slice.");
  page.parts.keeping.say("Finding what is kept ...", "busy");
  const kept = await trying(get("/api/kept", {}, page.abort.signal));
  if (kept && asked === page.choices) take(page, kept);
  return undefined;
}

function take(page, kept) {
  looked.moving = looked.held;
  if (kept.refused) return page.parts.keeping.say(kept.refused, "fault");
  keeps.restart({ key: kept.key });
  looked.kept = kept;
  settleWindow();
  showAll(page);
  tell("at");
  return undefined;
}

function showAll(page) {
  const there = Boolean(looked.geometry) && !page.listing;
  page.study.hidden = !there;
  page.showOpening.hidden = !(state.opened.browses || "series" in state.choices);
  page.study.classList.toggle("labels", isLabels());
  page.opening.element.hidden = there || ["study", "run"].includes(state.opened.kind) && !state.opened.ready && !state.opened.refused;
  if (!page.opening.element.hidden) page.opening.show();
  if (!looked.geometry) return;
  for (const part of Object.values(page.parts)) part.show();
  look();
}

const ACTIVE = { a: "axial", s: "sagittal", q: "coronal" };
let active = "axial";
on("active", ({ name }) => { active = name; });

function onKey(event, page) {
  if (!looked.geometry || page.study.hidden || event.target.type === "range") return false;
  const plane = page.planes[active];
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const steps = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10, Home: -1e6, End: 1e6 }[key];
  const tool = { c: "cross", p: "pick", b: "box" }[key];
  if (event.shiftKey && key.startsWith("Arrow")) crossBy(plane, key);
  else if (steps) plane.step(steps);
  else if (tool) useTool(tool);
  else if (ACTIVE[key]) page.planes[ACTIVE[key]].canvas.focus();
  else if (key === "m") plane.largest(active);
  else if (key === "+" || key === "-") plane.zoomBy(key === "+" ? 1.25 : 0.8);
  else if (key === "Enter" && event.target === plane.canvas) looked.tool === "box" ? setCorner(plane, page.parts.keeping.say) : plane.pick(looked.at);
  else if (key === "Escape" && corner) leaveCorner(page);
  else return false;
  return true;
}

let corner = null;

/** Set a corner of a box at the crosshair; with the other, both voxels included, it is chosen. */
function setCorner({ plane }, say) {
  const at = [looked.at[plane.rows], looked.at[plane.columns]];
  if (corner?.plane !== plane) {
    corner = { plane, at };
    return say("One corner is set. Shift and arrows lead the crosshair to the other, Enter sets it, Escape leaves.");
  }
  const ends = [Math.min, Math.max].map((end, n) => at.map((one, axis) => end(one, corner.at[axis]) + n));
  corner = null;
  return chooseBox(plane, ...ends);
}

function leaveCorner(page) {
  corner = null;
  page.parts.keeping.show();
}

function crossBy({ plane }, key) {
  const [axis, step] = { ArrowUp: [plane.rows, -1], ArrowDown: [plane.rows, 1], ArrowLeft: [plane.columns, -1], ArrowRight: [plane.columns, 1] }[key];
  const place = [...looked.at];
  place[axis] += plane.rows === axis && axis === 0 ? -step : step;
  goTo(place);
}
