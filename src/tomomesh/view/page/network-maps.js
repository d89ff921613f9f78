/** The U-matrix and the hits of a sheet of neurons, laid flat. */
import { el, short } from "./dom.js";

/** From few to many: light to dark in one hue, which everybody can follow. */
const SCALE = [[247, 251, 255], [158, 202, 225], [49, 130, 189], [8, 48, 107]];

function tint(share) {
  const at = Math.max(0, Math.min(share, 1)) * (SCALE.length - 1);
  const [low, rest] = [Math.min(Math.floor(at), SCALE.length - 2), at - Math.min(Math.floor(at), SCALE.length - 2)];
  return SCALE[low].map((one, n) => Math.round(one + rest * (SCALE[low + 1][n] - one)));
}

/**
 * Draw both maps.
 * @param {any} told as /api/training/maps tells it
 * @returns {Element[]}
 */
export function drawMaps({ hexagonal, unit, centers, far, places, hits }) {
  const dead = hits.filter((one) => one === 0).length;
  const between = `U-matrix: distance of neighbors${unit ? ` (${unit})` : ""}`;
  const won = `Hits: inputs won${dead ? `, ${dead} neuron${dead > 1 ? "s" : ""} without` : ""}`;
  return [map(between, centers, far, 0.5, hexagonal, false), map(won, places, hits, 1, hexagonal, true)];
}

function map(name, centers, values, side, hexagonal, numbered) {
  const [low, high] = [numbered ? 0 : Math.min(...values), Math.max(...values)];
  const canvas = el("canvas", { class: "net-map", width: 296, height: 240, role: "img", "aria-label": `${name}: ${short(low)} to ${short(high)}` });
  cells(canvas, centers, values, side, hexagonal, numbered, low, high);
  return el("figure", { class: "net-figure" }, el("figcaption", {}, `${name}: light ${short(low, 3)}, dark ${short(high, 3)}`), canvas);
}

function cells(canvas, centers, values, side, hexagonal, numbered, low, high) {
  const pen = canvas.getContext("2d");
  const xs = centers.filter((_, n) => n % 2 === 0);
  const ys = centers.filter((_, n) => n % 2 === 1);
  const [left, floor] = [Math.min(...xs) - side / 2, Math.min(...ys) - side / 2];
  const [wide, tall] = [Math.max(...xs) + side / 2 - left, Math.max(...ys) + side / 2 - floor];
  const scale = Math.min(canvas.width / wide, canvas.height / tall);
  const shift = (canvas.width - wide * scale) / 2;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.font = `${Math.min(11, scale * 0.42)}px system-ui, sans-serif`;
  values.forEach((value, n) => {
    const share = high > low ? (value - low) / (high - low) : 0;
    const [x, y] = [shift + (xs[n] - left) * scale, canvas.height - (ys[n] - floor) * scale - (canvas.height - tall * scale) / 2];
    pen.fillStyle = `rgb(${tint(share).join(" ")})`;
    cell(pen, x, y, side * scale, hexagonal);
    if (!numbered || values.length > 200) return;
    pen.fillStyle = share > 0.5 ? "#ffffff" : "#1b2429";
    pen.fillText(String(value), x, y);
  });
}

function cell(pen, x, y, size, hexagonal) {
  pen.beginPath();
  if (hexagonal) for (let n = 0; n < 6; n += 1) pen.lineTo(x + 0.6 * size * Math.sin((n * Math.PI) / 3), y + 0.6 * size * Math.cos((n * Math.PI) / 3));
  else pen.rect(x - size / 2 - 0.3, y - size / 2 - 0.3, size + 0.6, size + 0.6);
  pen.fill();
}
