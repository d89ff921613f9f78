/** A network over its inputs, drawn on a canvas: on a slice, in the plane, or in space. */
import { background, boxOf, edgesOf, limitsOf, regionsOf } from "./network-backdrop.js";

/** Pixels within which numbers would cover each other. */
const TOGETHER = 18;
/** Colors that everybody tells apart: Okabe and Ito's. */
const TOLD_APART = ["#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];

/**
 * @typedef {object} View what is drawn
 * @property {any} [course] a training, as /api/training tells it
 * @property {any} [frame] one of its frames
 * @property {any} [before] the frame before it
 * @property {{values: Float32Array, shape: number[]}} [inputs] where they are drawn
 * @property {any} [slice] gray levels and window, as `sliceOf` makes it
 * @property {{codebook: number[], edges: number[], bridged: number[]}[]} [networks] of all slices' training
 * @property {{image: boolean, window: boolean, inputs: boolean, regions: boolean, network: boolean}} layers
 * @property {{turn: number, tilt: number}} camera
 */

/** Draw a view. @param {HTMLCanvasElement} canvas @param {View} view */
export function draw(canvas, view) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  const colors = palette(canvas, Boolean(view.slice));
  pen.fillStyle = colors.ground;
  pen.fillRect(0, 0, width, height);
  const limits = limitsOf(view);
  if (!limits) return;
  const place = fitted(limits, width, height, view);
  background(pen, view, place, colors, { width, height, ratio });
  if (view.layers.regions && view.frame && view.inputs) drawRegions(pen, view, place);
  if (view.frame && view.layers.network) drawFrame(pen, view, place, colors);
  for (const one of (view.layers.network && view.networks) || []) drawNetwork(pen, one.codebook, 2, one.edges, new Set(one.bridged), place, colors);
  if (view.slice) scaleBar(pen, view.slice, place, height);
}

function palette(canvas, onSlice) {
  const style = getComputedStyle(canvas);
  const of = (name) => style.getPropertyValue(name).trim();
  if (onSlice) return { ground: "#000000", ink: "#ffffff", inputs: "#7fc4ff", link: "#ffb347", neuron: "#fff3e0", rim: "#8a3d00" };
  return { ground: of("--ground"), ink: of("--ink"), inputs: of("--net-inputs"), link: of("--accent"), neuron: of("--mark"), rim: of("--ground") };
}

/** Return what carries places to the canvas: what is wide and high enough, in the middle, rows as the slice has them. */
function fitted({ low, high }, width, height, view) {
  const margin = view.slice ? 6 : 26;
  const step = view.slice ? view.slice.spacing : [1, 1];
  const size = [0, 1].map((axis) => Math.max((high[axis] - low[axis]) * step[axis], 1e-9));
  const scale = Math.min((width - 2 * margin) / size[0], (height - 2 * margin) / size[1]);
  const down = view.slice ? !view.slice.upward : false;
  const [left, top] = [(width - size[0] * scale) / 2, (height - size[1] * scale) / 2];
  const project = view.course && view.course.dimensions === 3 ? turned(view) : null;
  const at = (x, y) => [left + (x - low[0]) * step[0] * scale, top + (down ? y - low[1] : high[1] - y) * step[1] * scale];
  return { at, project, scale, step };
}

/** Return what turns a place in space: x to the right, y up, z toward the viewer. */
function turned({ camera, course, inputs }) {
  const [ct, st, cl, sl] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
  const { low, high } = boxOf(course, inputs);
  const middle = low.map((one, axis) => (one + high[axis]) / 2);
  return (x, y, z) => {
    const [a, b, c] = [x - middle[0], y - middle[1], z - middle[2]];
    const [across, deep] = [a * ct - b * st, a * st + b * ct];
    return [across, c * cl - deep * sl, -(deep * cl + c * sl)];
  };
}

function drawFrame(pen, view, place, colors) {
  const { course, frame, before } = view;
  const last = frame.kind === "spaced" || (course.state === "done" && frame.n === course.count - 1);
  const edges = edgesOf(course, frame);
  const bridged = new Set(last && frame.neurons === course.neurons ? course.bridged : []);
  drawNetwork(pen, frame.codebook, course.dimensions, edges, bridged, place, colors);
  if (course.inputs === 1) drawUpdate(pen, view, place, colors, before || frame);
}

function placesOf(codebook, dimensions, place) {
  const found = [];
  for (let n = 0; n < codebook.length; n += dimensions) {
    const [x, y, deep] = place.project ? place.project(codebook[n], codebook[n + 1], codebook[n + 2]) : [codebook[n], codebook[n + 1], 0];
    found.push([...place.at(x, y), deep]);
  }
  return found;
}

function drawNetwork(pen, codebook, dimensions, edges, bridged, place, colors) {
  const places = placesOf(codebook, dimensions, place);
  const depths = places.map((one) => one[2]);
  const [far, near] = dimensions === 3 ? [Math.min(...depths), Math.max(...depths)] : [0, 0];
  const strength = (deep) => (near > far ? 0.25 + (0.75 * (deep - far)) / (near - far) : 1);
  const order = [...Array(edges.length / 2).keys()];
  const depthOf = (n) => places[edges[2 * n]][2] + places[edges[2 * n + 1]][2];
  if (near > far) order.sort((one, other) => depthOf(one) - depthOf(other));
  pen.strokeStyle = colors.link;
  for (const n of order) {
    pen.globalAlpha = strength(depthOf(n) / 2);
    pen.lineWidth = near > far ? 0.6 + 1.6 * pen.globalAlpha : 2;
    pen.setLineDash(bridged.has(n) ? [5, 4] : []);
    stroke(pen, places[edges[2 * n]], places[edges[2 * n + 1]]);
  }
  pen.setLineDash([]);
  const size = Math.max(2, Math.min(4.5, 0.3 * usual(places, edges)));
  const sorted = near > far ? [...places].sort((one, other) => one[2] - other[2]) : places;
  for (const one of sorted) {
    pen.globalAlpha = strength(one[2]);
    disc(pen, one, near > far ? size * (0.5 + 0.5 * pen.globalAlpha) : size, colors);
  }
  pen.globalAlpha = 1;
}

/** The usual length of a link: neurons are smaller than that, or they would hide it. */
function usual(places, edges) {
  const lengths = [];
  for (let n = 0; n < edges.length; n += 2) lengths.push(Math.hypot(places[edges[n]][0] - places[edges[n + 1]][0], places[edges[n]][1] - places[edges[n + 1]][1]));
  return lengths.sort((one, other) => one - other)[lengths.length >> 1] || 9;
}

function stroke(pen, from, to) {
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0], to[1]);
  pen.stroke();
}

function disc(pen, [x, y], size, colors) {
  pen.beginPath();
  pen.arc(x, y, size, 0, 2 * Math.PI);
  pen.fillStyle = colors.neuron;
  pen.fill();
  pen.lineWidth = 1;
  pen.strokeStyle = colors.rim;
  pen.stroke();
}

/** Show who won a single input and who followed it: rings around those that moved, a double one around the winner. */
function drawUpdate(pen, { frame, inputs }, place, colors, before) {
  const now = placesOf(frame.codebook, 2, place);
  const then = placesOf(before.codebook, 2, place);
  const signal = inputs ? place.at(inputs.values[0], inputs.values[1]) : null;
  pen.font = "600 13px system-ui, sans-serif";
  pen.lineWidth = 1.6;
  const winner = signal ? nearest(then, signal) : -1;
  now.forEach((one, n) => {
    const moved = Math.hypot(one[0] - then[n][0], one[1] - then[n][1]) > 1e-6;
    pen.strokeStyle = colors.link;
    if (moved) {
      pen.setLineDash([3, 3]);
      stroke(pen, then[n], one);
      pen.setLineDash([]);
      circle(pen, one, 9);
      if (n === winner) circle(pen, one, 13);
    }
  });
  pen.fillStyle = colors.ink;
  for (const [[x, y], numbers] of numbered(now)) pen.fillText(numbers, x + 12, y - 13);
  if (signal) cross(pen, signal, colors);
}

/** Where numbers of neurons are written: those that lie together have one word. */
function numbered(places) {
  const found = [];
  places.forEach((place, n) => {
    const beside = found.find(([other]) => Math.hypot(place[0] - other[0], place[1] - other[1]) < TOGETHER);
    if (beside) beside[1] += `, ${n + 1}`;
    else found.push([place, String(n + 1)]);
  });
  return found;
}

function nearest(places, [x, y]) {
  const away = places.map((one) => Math.hypot(one[0] - x, one[1] - y));
  return away.indexOf(Math.min(...away));
}

function circle(pen, [x, y], size) {
  pen.beginPath();
  pen.arc(x, y, size, 0, 2 * Math.PI);
  pen.stroke();
}

function cross(pen, [x, y], colors) {
  pen.strokeStyle = colors.neuron;
  pen.lineWidth = 3;
  stroke(pen, [x - 8, y - 8], [x + 8, y + 8]);
  stroke(pen, [x - 8, y + 8], [x + 8, y - 8]);
  pen.fillStyle = colors.ink;
  pen.fillText("input x(t)", x + 14, y + 5);
}

function drawRegions(pen, view, place) {
  const { inputs, frame, course } = view;
  const winners = regionsOf(inputs, frame, course.dimensions);
  const size = view.slice ? Math.max(place.scale * Math.min(...place.step), 1.5) : 4;
  pen.globalAlpha = 0.75;
  winners.forEach((winner, n) => {
    const at = n * course.dimensions;
    const [x, y] = place.project ? place.project(...inputs.values.subarray(at, at + 3)) : inputs.values.subarray(at, at + 2);
    const [left, top] = place.at(x, y);
    pen.fillStyle = TOLD_APART[winner % TOLD_APART.length];
    pen.fillRect(left - size / 2, top - size / 2, size, size);
  });
  pen.globalAlpha = 1;
}

function scaleBar(pen, slice, place, height) {
  const length = [100, 50, 20, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05].find((mm) => mm * place.scale < 140) || 0.02;
  pen.strokeStyle = pen.fillStyle = "#ffffff";
  pen.lineWidth = 2;
  stroke(pen, [14, height - 14], [14 + length * place.scale, height - 14]);
  pen.font = "12px system-ui, sans-serif";
  pen.fillText(`${length} mm`, 14, height - 20);
}
