/** What lies behind a network: the slice, what is kept of it, the inputs. */

const KEPT = [86, 180, 233, 120];
/** Inputs in space that are drawn at most: they are turned with every frame. */
const MOST = 6000;

/**
 * Make a slice of what /training/picture hands out.
 * @param {{values: Uint8Array, shape: number[], headers: Headers}} found
 */
export function sliceOf({ values, shape, headers }) {
  const [, rows, columns] = shape;
  const area = rows * columns;
  const paint = (color) => {
    const drawn = new OffscreenCanvas(columns, rows);
    const image = new ImageData(columns, rows);
    for (let n = 0; n < area; n += 1) image.data.set(color(n), 4 * n);
    drawn.getContext("2d").putImageData(image, 0, 0);
    return drawn;
  };
  return {
    rows, columns,
    count: values.subarray(area).reduce((sum, one) => sum + one, 0),
    spacing: headers.get("x-spacing").split(",").map(Number),
    upward: headers.get("x-upward") === "1",
    gray: paint((n) => [values[n], values[n], values[n], 255]),
    kept: paint((n) => (values[area + n] ? KEPT : [0, 0, 0, 0])),
  };
}

/** What was drawn last behind a network, and of what: it stays from epoch to epoch. */
let kept = { of: /** @type {any[]} */ ([]), drawn: /** @type {any} */ (null) };

/**
 * Draw the slice, the window and the inputs.
 * @param {CanvasRenderingContext2D} pen
 * @param {any} view
 * @param {any} place
 * @param {any} colors
 * @param {{width: number, height: number, ratio: number}} size
 */
export function background(pen, view, place, colors, { width, height, ratio }) {
  const { slice, inputs, layers } = view;
  if (place.project) return behind(pen, view, place, colors);
  const of = [slice, inputs, width, height, ratio, colors.inputs, layers.image, layers.window, layers.inputs, layers.regions];
  if (!kept.drawn || of.some((one, n) => one !== kept.of[n])) {
    const drawn = new OffscreenCanvas(Math.round(width * ratio), Math.round(height * ratio));
    const own = drawn.getContext("2d");
    own.setTransform(ratio, 0, 0, ratio, 0, 0);
    behind(own, view, place, colors);
    kept = { of, drawn };
  }
  return pen.drawImage(kept.drawn, 0, 0, width, height);
}

function behind(pen, view, place, colors) {
  const { slice, layers } = view;
  if (slice && layers.image) picture(pen, slice, slice.gray, place);
  if (slice && layers.window) picture(pen, slice, slice.kept, place);
  const pixels = slice && layers.window && view.inputs && view.inputs.shape[0] === slice.count; // they are blue already
  if (view.inputs && layers.inputs && !layers.regions && !pixels && view.inputs.shape[0] > 1) dots(pen, view, place, colors);
}

function picture(pen, { rows, columns, upward }, drawn, place) {
  const [left, first] = place.at(-0.5, -0.5);
  const [right, last] = place.at(columns - 0.5, rows - 0.5);
  pen.save();
  pen.imageSmoothingEnabled = false;
  if (upward) {
    pen.translate(0, first + last);
    pen.scale(1, -1);
  }
  pen.drawImage(drawn, left, Math.min(first, last), right - left, Math.abs(last - first));
  pen.restore();
}

function dots(pen, { inputs, course, slice }, place, colors) {
  const size = slice ? 2 : Math.max(1.5, Math.min(4, 160 / Math.sqrt(inputs.shape[0])));
  pen.fillStyle = colors.inputs;
  pen.globalAlpha = course.dimensions === 3 ? 0.35 : 0.9;
  const step = course.dimensions === 3 ? Math.ceil(inputs.shape[0] / MOST) : 1;
  for (let n = 0; n < inputs.values.length; n += step * course.dimensions) {
    const three = inputs.values.subarray(n, n + course.dimensions);
    const [x, y] = place.project ? place.project(three[0], three[1], three[2]) : three;
    const [left, top] = place.at(x, y);
    pen.fillRect(left - size / 2, top - size / 2, size, size);
  }
  pen.globalAlpha = 1;
}

/** Return the box that is to be seen, which stays as it is from frame to frame. */
export function limitsOf({ course, inputs, slice }) {
  if (slice) return { low: [-0.5, -0.5], high: [slice.columns - 0.5, slice.rows - 0.5] };
  if (!course || !inputs) return null;
  if (course.inputs === 1) return { low: [-1.2, -1.15], high: [1.2, 1.15] };
  const { low, high, reach } = boxOf(course, inputs);
  return course.dimensions === 3 ? { low: [-reach, -reach], high: [reach, reach] } : { low, high };
}

/** Return the box of the inputs, and the ball around it, within which it can be turned. */
export function boxOf(course, { values }) {
  if (course.box) return course.box;
  const axes = [...Array(course.dimensions).keys()];
  const low = axes.map(() => Infinity);
  const high = axes.map(() => -Infinity);
  values.forEach((value, n) => {
    const axis = n % axes.length;
    low[axis] = Math.min(low[axis], value);
    high[axis] = Math.max(high[axis], value);
  });
  course.box = { low, high, reach: Math.hypot(...axes.map((axis) => (high[axis] - low[axis]) / 2)) };
  return course.box;
}

/** Return the links of a frame's network: of a ring of fewer neurons where its slice has few inputs. */
export function edgesOf(course, frame) {
  if (frame.neurons === course.neurons) return course.edges;
  return [...Array(frame.neurons).keys()].flatMap((n) => [n, (n + 1) % frame.neurons]);
}

/** Return the neuron that is nearest to each input (eq. 1): the regions of Fig. 5. */
export function regionsOf({ values }, { codebook }, dimensions) {
  const winners = new Uint16Array(values.length / dimensions);
  for (let n = 0; n < winners.length; n += 1) {
    let best = Infinity;
    for (let m = 0; m * dimensions < codebook.length; m += 1) {
      let apart = 0;
      for (let axis = 0; axis < dimensions; axis += 1) apart += (values[n * dimensions + axis] - codebook[m * dimensions + axis]) ** 2;
      if (apart < best) [best, winners[n]] = [apart, m];
    }
  }
  return winners;
}
