/** What is looked at in the study; its parts tell one another of changes by `tell`, as of "look", "at" and "under". */
import { state, tell } from "./store.js";

/**
 * - geometry, survey, kept: the answers of /api/planes, /api/study and /api/kept, null before they have come
 * - at: the voxel (K, J, I) of the crosshair
 * - contrast: which gray levels are drawn from black to white
 * - window: the bounds of each layer; moving, while they are not what is kept yet; held, while a hand holds them
 * - tool: what a click does: cross, pick or box
 * @type {any}
 */
export const looked = {
  geometry: null, survey: null, kept: null, at: [0, 0, 0], contrast: { center: 0, width: 1 },
  window: { lower: [-Infinity], upper: [Infinity] }, moving: false, held: false, opacity: 0.5, tool: "cross", layer: 0,
};

/** Have all planes drawn again. */
export const look = () => tell("look");

/** Lead the crosshair to a voxel (K, J, I), as near as the study has one. @param {number[]} place */
export function goTo(place) {
  looked.at = place.map((n, axis) => Math.min(Math.max(Math.round(n), 0), looked.geometry.shape[axis] - 1));
  tell("at");
}

/** Where a voxel (K, J, I) is in the patient, in mm. @param {number[]} place @returns {number[]} */
export function inPatient([k, j, i]) {
  return looked.geometry.affine.slice(0, 3).map((row) => row[0] * i + row[1] * j + row[2] * k + row[3]);
}

/** The unit of the gray levels, as it is written behind a number. */
export const unit = () => (looked.geometry.unit === "HU" ? " HU" : "");

/** Whether the study is a label map, and no gray levels of it were asked for. */
export const isLabels = () => Boolean(looked.survey && !looked.geometry.labelled && Object.keys(looked.survey.labels).length) && !["lower", "upper", "preset"].some((name) => name in state.choices);
