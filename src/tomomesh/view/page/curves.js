/** Curves over the epochs of a training, with axes that are named. */
import { short } from "./dom.js";

const SVG = "http://www.w3.org/2000/svg";
const [WIDE, HIGH, LEFT, RIGHT, TOP, BOTTOM] = [300, 128, 46, 10, 20, 28];

function svg(tag, having = {}, ...within) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(having)) made.setAttribute(name, String(value));
  made.append(...within);
  return made;
}

/** Round ends of an axis: 0 and the next 1, 2 or 5 times a power of ten. @param {number} most */
export function ceiling(most) {
  if (!(most > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  return [1, 2, 5, 10].map((times) => times * power).find((end) => end >= most * (1 - 1e-9)) || most;
}

/**
 * Draw a curve.
 * @param {object} curve
 * @param {string} curve.name what it tells, with its unit
 * @param {string} curve.along what the epochs are
 * @param {number[]} curve.steps
 * @param {number[]} curve.values
 * @param {number} curve.at which is shown
 * @param {number} curve.last the last step of all that are planned
 * @param {(at: number) => void} curve.go goes to a frame
 * @returns {SVGElement}
 */
export function curve({ name, along, steps, values, at, last, go }) {
  const top = ceiling(Math.max(...values, 0));
  const end = Math.max(last, steps[steps.length - 1] || 0, 1);
  const x = (step) => LEFT + ((WIDE - LEFT - RIGHT) * step) / end;
  const y = (value) => HIGH - BOTTOM - ((HIGH - BOTTOM - TOP) * value) / top;
  const path = values.map((value, n) => `${n ? "L" : "M"}${x(steps[n]).toFixed(1)} ${y(value).toFixed(1)}`).join("");
  const drawn = svg("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, class: "curve", role: "img" });
  drawn.append(...axes(name, along, top, end, x, y), svg("path", { d: path, class: "curve-line" }));
  if (at >= 0 && at < values.length) drawn.append(...marked(x(steps[at]), y(values[at]), values[at]));
  drawn.setAttribute("aria-label", `${name}: ${short(values[Math.max(at, 0)] ?? NaN)}`);
  drawn.addEventListener("pointerdown", (event) => {
    const box = drawn.getBoundingClientRect();
    go(nearest(steps, ((((event.clientX - box.left) / box.width) * WIDE - LEFT) / (WIDE - LEFT - RIGHT)) * end));
  });
  return drawn;
}

function nearest(steps, wanted) {
  return steps.reduce((best, step, n) => (Math.abs(step - wanted) < Math.abs(steps[best] - wanted) ? n : best), 0);
}

function axes(name, along, top, end, x, y) {
  const floor = HIGH - BOTTOM;
  const words = (text, left, high, anchor) => svg("text", { x: left, y: high, "text-anchor": anchor }, text);
  return [
    svg("path", { d: `M${LEFT} ${TOP}V${floor}H${WIDE - RIGHT}`, class: "curve-axis" }),
    svg("path", { d: `M${LEFT} ${y(top / 2)}H${WIDE - RIGHT}M${LEFT} ${y(top)}H${WIDE - RIGHT}`, class: "curve-grid" }),
    words(name, LEFT, 12, "start"),
    ...[0, top / 2, top].map((value) => words(short(value, 3), LEFT - 5, y(value) + 4, "end")),
    words("0", x(0), floor + 13, "middle"),
    words(end.toLocaleString("en"), x(end), floor + 13, "end"),
    words(along, (x(0) + x(end)) / 2, floor + 24, "middle"),
  ];
}

function marked(x, y, value) {
  return [
    svg("path", { d: `M${x.toFixed(1)} ${TOP}V${HIGH - BOTTOM}`, class: "curve-now" }),
    svg("circle", { cx: x.toFixed(1), cy: y.toFixed(1), r: 4, class: "curve-dot" }),
    svg("text", { x: WIDE - RIGHT, y: 12, "text-anchor": "end", class: "curve-value" }, short(value)),
  ];
}
