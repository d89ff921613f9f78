/** The part of a study that matters: a box in the patient, dragged on a plane, and a range of slices. */
import { el } from "./dom.js";
import { inPatient, looked } from "./looked.js";
import { choose, state } from "./store.js";

const NAMES = ["X from", "X to", "Y from", "Y to", "Z from", "Z to"];

/** The sides of the study in the patient, half a voxel around: X0 X1 Y0 Y1 Z0 Z1. */
export function sides() {
  const { shape } = looked.geometry;
  return boxAround([0, 0, 0], shape.map((size) => size - 1));
}

/** A box in the patient around the voxels (K, J, I) from some to others, half of one wider. @param {number[]} low @param {number[]} high */
export function boxAround(low, high) {
  const ends = [0, 1, 2].map((axis) => [low[axis] - 0.5, high[axis] + 0.5]);
  const corners = ends[0].flatMap((k) => ends[1].flatMap((j) => ends[2].map((i) => inPatient([k, j, i]))));
  return [0, 1, 2].flatMap((axis) => [Math.min, Math.max].map((end) => Number(end(...corners.map((one) => one[axis])).toFixed(3))));
}

/**
 * Keep what lies in a box that was dragged on a plane; across it the box stays as it was.
 * @param {any} plane
 * @param {number[]} from a row and a column
 * @param {number[]} to
 */
export function chooseBox(plane, from, to) {
  const { shape } = looked.geometry;
  const [low, high] = [[0, 0, 0], shape.map((size) => size - 1)];
  [plane.rows, plane.columns].forEach((axis, n) => {
    low[axis] = Math.max(0, Math.floor(Math.min(from[n], to[n])));
    high[axis] = Math.min(shape[axis] - 1, Math.ceil(Math.max(from[n], to[n])) - 1);
  });
  const box = boxAround(low, high);
  const whole = sides();
  const across = looked.geometry.affine.slice(0, 3).map((row) => Math.abs(row[2 - plane.axis]));
  const main = across.indexOf(Math.max(...across));
  const before = state.choices.roi || whole;
  [2 * main, 2 * main + 1].forEach((side) => { box[side] = before[side]; });
  choose({ roi: box });
}

/**
 * Which pixels of a slice lie outside of the box and the range of slices, 1 there; null where none can.
 * @param {any} plane
 * @param {number} k
 */
export function outsideOf(plane, k) {
  const { roi, slice_range: range } = state.choices;
  if (!roi && !range) return null;
  const [rows, columns] = plane.size;
  const out = new Uint8Array(rows * columns);
  if (roi) outsideBox(out, plane, k, roi);
  if (range) outsideRange(out, plane, k, range);
  return out;
}

function outsideBox(out, plane, k, roi) {
  const [rows, columns] = plane.size;
  for (let axis = 0; axis < 3; axis++) {
    const line = looked.geometry.affine[axis];
    const [across, down, right] = [plane.axis, plane.rows, plane.columns].map((one) => line[2 - one]);
    const slack = 1e-6 * Math.max(...line.slice(0, 3).map(Math.abs));
    const [low, high] = [roi[2 * axis] - slack, roi[2 * axis + 1] + slack];
    for (let row = 0; row < rows; row++) {
      const start = line[3] + across * k + down * row;
      for (let column = 0, n = row * columns; column < columns; column++, n++) {
        const place = start + right * column;
        if (place < low || place > high) out[n] = 1;
      }
    }
  }
}

function outsideRange(out, plane, k, range) {
  const axis = slicesAxis();
  const [first, last] = range.map((one) => (one < 0 ? one + looked.geometry.shape[axis] : one));
  const [rows, columns] = plane.size;
  if (plane.axis === axis) {
    if (k < first || k > last) out.fill(1);
  } else if (plane.rows === axis) {
    out.fill(1, 0, first * columns).fill(1, (last + 1) * columns);
  } else {
    for (let row = 0; row < rows; row++) out.fill(1, row * columns, row * columns + first).fill(1, row * columns + last + 1, (row + 1) * columns);
  }
}

/** The axis of (K, J, I) along which slices are counted. */
export const slicesAxis = () => looked.geometry.planes[looked.survey?.slices || "axial"].axis;

/** The section of the panel. @returns {{element: HTMLElement, show: () => void}} */
export function makeRegion() {
  const ends = [0, 1].map((n) => el("input", { type: "number", min: 0, step: 1, "aria-label": `${["first", "last"][n]} slice`, onchange: () => chooseRange(n, Number(ends[n].value)) }));
  const here = [0, 1].map((n) => el("button", { type: "button", title: `The crosshair's slice is the ${["first", "last"][n]}`, onclick: () => chooseRange(n, looked.at[slicesAxis()]) }, "here"));
  const box = NAMES.map((name, n) => el("input", { type: "number", step: "any", "aria-label": `box, ${name}`, onchange: () => chooseSide(n, Number(box[n].value)) }));
  const plane = el("span");
  const clear = el("button", { type: "button", onclick: () => choose({ roi: null, slice_range: null }) }, "All of the study");
  const rows = ["X", "Y", "Z"].map((axis, n) => el("div", { class: "fields" }, el("span", {}, axis), box[2 * n], "to", box[2 * n + 1]));
  const element = el("details", { class: "part" },
    el("summary", {}, "Part of the study"),
    el("div", { class: "fields" }, plane, ends[0], here[0], "to", ends[1], here[1]),
    el("p", { class: "hint" }, "Box in the patient, mm (LPS). Drag it with the tool Box, or type it."),
    ...rows, clear);
  const show = () => {
    if (!looked.geometry) return;
    const { roi, slice_range: range } = state.choices;
    const last = looked.geometry.shape[slicesAxis()] - 1;
    plane.textContent = looked.survey?.slices || "";
    ends.forEach((input, n) => { input.max = String(last); input.value = String(range ? (range[n] < 0 ? range[n] + last + 1 : range[n]) : [0, last][n]); });
    box.forEach((input, n) => { input.value = String((roi || sides())[n]); });
    clear.disabled = !roi && !range;
    if (roi || range) element.open = true;
  };
  return { element, show };
}

function chooseRange(n, slice) {
  const last = looked.geometry.shape[slicesAxis()] - 1;
  const range = [...(state.choices.slice_range || [0, last])];
  range[n] = slice;
  choose({ slice_range: range[0] === 0 && range[1] === last ? null : range });
}

function chooseSide(n, mm) {
  const box = [...(state.choices.roi || sides())];
  box[n] = mm;
  choose({ roi: box });
}
