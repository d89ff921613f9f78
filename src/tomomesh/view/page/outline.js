/** A slice with the mesh's outline on it: an error is seen there as well as in 3-D. */
import { numbers } from "./api.js";
import { el } from "./dom.js";
import { state, trying } from "./store.js";

const SIDE = 660;
const LINE = 2;

/**
 * Make the picture; `show(plane, k, ends, of)` draws a slice and the segments (s, 2, 2) that lie on it, of a plane as
 * /api/planes tells of it.
 */
export function sliceWithOutline() {
  const canvas = el("canvas", { class: "outline", role: "img", "aria-label": "The slice with the outline of the mesh" });
  let drawn = 0;
  async function show(plane, k, ends, of) {
    const asked = (drawn += 1);
    const slice = await trying(numbers(`/slice/${plane}/${k}`));
    if (!slice || asked !== drawn) return;
    draw(canvas, slice, ends, of);
  }
  return { element: canvas, show };
}

/** Rows of coronal and sagittal slices rise to the head, which is drawn above. */
function draw(canvas, { values, shape }, ends, { pixel_mm: [dy, dx], rows: axis }) {
  const [rows, columns] = shape;
  const scale = SIDE / Math.max(columns * dx, rows * dy);
  canvas.width = Math.round(columns * dx * scale);
  canvas.height = Math.round(rows * dy * scale);
  const context = canvas.getContext("2d");
  if (axis === 0) context.setTransform(1, 0, 0, -1, 0, canvas.height);
  context.drawImage(picture(values, rows, columns, values.length / rows / columns), 0, 0, canvas.width, canvas.height);
  context.lineWidth = LINE;
  context.strokeStyle = getComputedStyle(canvas).getPropertyValue("--trace");
  context.beginPath();
  for (let n = 0; n < ends.length; n += 4) {
    context.moveTo((ends[n] + 0.5) * dx * scale, (ends[n + 1] + 0.5) * dy * scale);
    context.lineTo((ends[n + 2] + 0.5) * dx * scale, (ends[n + 3] + 0.5) * dy * scale);
  }
  context.stroke();
}

function picture(values, rows, columns, layers) {
  const [low, high] = span(values);
  const data = new Uint8ClampedArray(4 * rows * columns);
  for (let n = 0; n < rows * columns; n += 1) {
    for (let c = 0; c < 3; c += 1) {
      const level = values[layers > 1 ? n * layers + Math.min(c, layers - 1) : n];
      data[4 * n + c] = layers > 1 ? level : (255 * (level - low)) / (high - low || 1);
    }
    data[4 * n + 3] = 255;
  }
  const made = new OffscreenCanvas(columns, rows);
  made.getContext("2d").putImageData(new ImageData(data, columns, rows), 0, 0);
  return made;
}

function span(values) {
  const { lower, upper } = state.choices;
  if (typeof lower === "number" && typeof upper === "number") return [lower - (upper - lower), upper + (upper - lower)];
  const some = Float32Array.from({ length: Math.min(values.length, 4096) }, (_, n) => values[Math.floor((n * values.length) / Math.min(values.length, 4096))]).sort();
  return [some[Math.floor(0.01 * (some.length - 1))], some[Math.floor(0.99 * (some.length - 1))]];
}
