/** The histogram of all gray levels, with the two bounds of the window as handles. */
import { eachFrame, el, short } from "./dom.js";
import { look, looked, unit } from "./looked.js";
import { on, tell } from "./store.js";
import { boundsOf, chooseBounds } from "./windowing.js";

const NAMES = ["lower", "upper"];
const PATIENCE = 400;

/** The histogram. @returns {{element: HTMLElement, draw: () => void}} */
export function makeHistogram() {
  const canvas = el("canvas", { "aria-hidden": "true" });
  const handles = NAMES.map((name, n) => makeHandle(name, n));
  const element = el("figure", { class: "histogram" }, canvas, el("span", { class: "caption" }, "voxels a gray level, log scale"), ...handles);
  const draw = eachFrame(() => drawAll(canvas, handles));
  on("look", draw);
  on("theme", draw);
  new ResizeObserver(draw).observe(element);
  return { element, draw };
}

function makeHandle(name, n) {
  const handle = el("div", { class: `handle ${name}`, role: "slider", tabindex: 0, "aria-label": `${name} bound of the window`, "aria-orientation": "horizontal" });
  handle.onpointerdown = (event) => {
    handle.setPointerCapture(event.pointerId);
    handle.focus();
    event.preventDefault();
  };
  handle.onpointermove = (event) => {
    if (!handle.hasPointerCapture(event.pointerId)) return;
    const box = handle.parentElement.getBoundingClientRect();
    moveTo(n, atShare((event.clientX - box.left) / box.width));
  };
  handle.onpointerup = () => chooseBounds();
  handle.onkeydown = (event) => onKey(event, n);
  return handle;
}

let waiting = 0;

function onKey(event, n) {
  const { histogram_from: from, histogram_to: to } = looked.survey;
  const step = looked.geometry.whole ? Math.max(1, Math.round((to - from) / 500)) : (to - from) / 500;
  const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 20, PageDown: -20 }[event.key];
  const ends = { Home: from, End: to }[event.key];
  if (steps === undefined && ends === undefined) return;
  event.preventDefault();
  event.stopPropagation();
  const shown = clamped(boundsOf(n)[looked.layer]);
  moveTo(n, ends ?? shown + steps * step * (event.shiftKey ? 10 : 1));
  clearTimeout(waiting);
  waiting = setTimeout(chooseBounds, PATIENCE);
}

function atShare(share) {
  const { histogram_from: from, histogram_to: to } = looked.survey;
  const level = from + Math.min(Math.max(share, 0), 1) * (to - from);
  return looked.geometry.whole ? Math.round(level) : Number(level.toPrecision(5));
}

/** Move a bound while it is dragged; at the end of the histogram it is none. */
function moveTo(n, level) {
  const { histogram_from: from, histogram_to: to } = looked.survey;
  const [lower, upper] = [0, 1].map((other) => boundsOf(other)[looked.layer]);
  const gap = looked.geometry.whole ? 1 : (to - from) / 1000;
  const free = n === 0 ? Math.min(level, upper - gap) : Math.max(level, lower + gap);
  boundsOf(n)[looked.layer] = n === 0 && free <= from ? -Infinity : n === 1 && free >= to ? Infinity : free;
  looked.moving = looked.held = true;
  look();
  tell("window");
}

function clamped(level) {
  const { histogram_from: from, histogram_to: to } = looked.survey;
  return Math.min(Math.max(level, from), to);
}

function drawAll(canvas, handles) {
  const { survey } = looked;
  if (!survey || !canvas.clientWidth) return;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const dots = devicePixelRatio;
  Object.assign(canvas, { width: Math.round(width * dots), height: Math.round(height * dots) });
  const pen = canvas.getContext("2d");
  pen.scale(dots, dots);
  drawBars(pen, width, height - 10, survey);
  drawRamp(pen, width, height);
  handles.forEach((handle, n) => placeHandle(handle, n, width));
}

const share = (level) => (clamped(level) - looked.survey.histogram_from) / (looked.survey.histogram_to - looked.survey.histogram_from || 1);

function drawBars(pen, width, height, { histogram }) {
  const [inside, outside] = ["--mark", "--muted"].map((name) => getComputedStyle(pen.canvas).getPropertyValue(name));
  const most = Math.log1p(Math.max(...histogram));
  const [low, high] = [0, 1].map((n) => share(boundsOf(n)[looked.layer]));
  const dot = 1 / devicePixelRatio;
  for (let x = 0; x < width; x += dot) {
    const at = x / width;
    const count = histogram[Math.floor(at * histogram.length)];
    const tall = Math.round((Math.log1p(count) / most) * (height - 20) * devicePixelRatio) * dot;
    pen.fillStyle = at > low && at <= high ? inside : outside;
    pen.fillRect(x, height - tall, dot, tall);
  }
}

/** Draw below the bars which levels are drawn from black to white. */
function drawRamp(pen, width, height) {
  const { center, width: wide } = looked.contrast;
  const ramp = pen.createLinearGradient(0, 0, width, 0);
  const { histogram_from: from, histogram_to: to } = looked.survey;
  for (let n = 0; n <= 32; n++) {
    const tone = Math.min(Math.max((from + (n / 32) * (to - from) - center) / wide + 0.5, 0), 1) * 255;
    ramp.addColorStop(n / 32, `rgb(${tone} ${tone} ${tone})`);
  }
  pen.fillStyle = ramp;
  pen.fillRect(0, height - 8, width, 8);
}

function placeHandle(handle, n, width) {
  const level = boundsOf(n)[looked.layer];
  const text = Number.isFinite(level) ? `${short(level, 5)}${unit()}` : "no limit";
  handle.style.left = `${share(level) * width}px`;
  handle.dataset.text = text;
  handle.setAttribute("aria-valuemin", String(looked.survey.histogram_from));
  handle.setAttribute("aria-valuemax", String(looked.survey.histogram_to));
  handle.setAttribute("aria-valuenow", String(clamped(level)));
  handle.setAttribute("aria-valuetext", text);
}
