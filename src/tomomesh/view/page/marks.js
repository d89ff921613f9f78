/** What is drawn over a slice: the crosshair, the letters of the patient's sides, the scale bar, the box. */

const NICE = [1, 2, 5, 10, 20, 50, 100, 200, 500];
const LONGEST = 0.3;

/** The colors of the planes' lines, as viewers of our field have them. */
export const LINES = { axial: "#ff6b5e", coronal: "#5fd38a", sagittal: "#f5d547" };

/**
 * How a plane lies on its canvas: the place of a pixel's corner, in CSS pixels.
 * @param {any} plane of /api/planes
 * @param {{width: number, height: number}} room
 * @param {{zoom: number, x: number, y: number}} looked how often larger, and what part of it is in the middle
 */
export function placed(plane, room, { zoom, x, y }) {
  const [rows, columns] = plane.size;
  const [tall, wide] = plane.pixel_mm;
  const scale = Math.min(room.width / (columns * wide), room.height / (rows * tall)) * zoom;
  const [width, height] = [columns * wide * scale, rows * tall * scale];
  return { left: room.width / 2 - x * width, top: room.height / 2 - y * height, width, height, scale, flipped: plane.rows === 0, rows, columns };
}

/** The row and column under a point, not rounded: a pixel goes from its number to the next. @param {any} lie @param {number} x @param {number} y */
export function under(lie, x, y) {
  const down = ((y - lie.top) / lie.height) * lie.rows;
  return [lie.flipped ? lie.rows - down : down, ((x - lie.left) / lie.width) * lie.columns];
}

/** The point of a row and column. @param {any} lie @param {number} row @param {number} column */
export function pointOf(lie, row, column) {
  const down = lie.flipped ? lie.rows - row : row;
  return [lie.left + (column / lie.columns) * lie.width, lie.top + (down / lie.rows) * lie.height];
}

/** Draw the lines of the other two planes, with a gap where they cross. */
export function drawCross(pen, room, [x, y], upright, level) {
  const gap = 9;
  for (const [color, from, to] of [
    [upright, [x, 0], [x, y - gap]], [upright, [x, y + gap], [x, room.height]],
    [level, [0, y], [x - gap, y]], [level, [x + gap, y], [room.width, y]],
  ]) {
    pen.strokeStyle = color;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(Math.round(from[0]) + 0.5, Math.round(from[1]) + 0.5);
    pen.lineTo(Math.round(to[0]) + 0.5, Math.round(to[1]) + 0.5);
    pen.stroke();
  }
}

function written(pen, text, x, y, align) {
  pen.textAlign = align;
  pen.lineWidth = 3;
  pen.strokeStyle = "#000";
  pen.strokeText(text, x, y);
  pen.fillStyle = "#fff";
  pen.fillText(text, x, y);
}

/** Draw the letters of the patient's sides at the edges. */
export function drawLetters(pen, room, { letters }, flipped) {
  const [top, bottom] = flipped ? [letters.rows[1], letters.rows[0]] : letters.rows;
  pen.font = "600 13px system-ui, sans-serif";
  pen.textBaseline = "middle";
  written(pen, letters.columns[0], 6, room.height / 2, "left");
  written(pen, letters.columns[1], room.width - 6, room.height / 2, "right");
  written(pen, top, room.width / 2, 12, "center");
  written(pen, bottom, room.width / 2, room.height - 12, "center");
}

/** Draw a bar of a round length in mm. */
export function drawScale(pen, room, scale) {
  const length = NICE.filter((one) => one * scale <= LONGEST * room.width).pop();
  if (!length) return;
  const [left, y] = [10, room.height - 10];
  for (const [color, width] of [["#000", 5], ["#fff", 2]]) {
    pen.strokeStyle = color;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(left, y - 5);
    pen.lineTo(left, y);
    pen.lineTo(left + length * scale, y);
    pen.lineTo(left + length * scale, y - 5);
    pen.stroke();
  }
  pen.font = "12px system-ui, sans-serif";
  pen.textBaseline = "bottom";
  written(pen, `${length} mm`, left + 4, y - 5, "left");
}

/** Draw the box that is being dragged. */
export function drawBox(pen, [x0, y0], [x1, y1]) {
  pen.setLineDash([5, 4]);
  for (const [color, offset] of [["#000", 0], ["#fff", 5]]) {
    pen.strokeStyle = color;
    pen.lineWidth = 1.5;
    pen.lineDashOffset = offset;
    pen.strokeRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
  }
  pen.setLineDash([]);
}
