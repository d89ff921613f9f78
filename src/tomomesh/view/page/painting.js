/** Gray levels to colors, by tables: a window or a contrast that moves costs one table and a look-up a pixel. */

/** Colors that the color-blind tell apart (Okabe and Ito), for components from the largest on. */
export const COLORS = ["#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];
const DROPPED = 256;
const MOVING = 257;
const OUTSIDE = 258;
const ROWS = 259;
const GRAY = [158, 158, 158];
const OUT_OF_BOX = 0.35;

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const packed = (r, g, b) => ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
const DROPPED_COLOR = packed(...GRAY);

/** The color of a component, as CSS. @param {number} number */
export const colorOf = (number) => COLORS[(number - 1) % COLORS.length];

/** The color of a label, as CSS: neighbors in number lie a golden angle apart. @param {number} label */
export const labelColor = (label) => `hsl(${((label % 360) * 137.508) % 360} 70% ${[62, 48, 74][label % 3]}%)`;

/**
 * How numbers of a slice lead into tables.
 * @param {any} values the slice's array
 * @param {{lowest: number, highest: number, whole: boolean}} range
 * @returns {{size: number, level: (n: number) => number, indices: (values: any) => any}}
 */
export function scaleOf(values, { lowest, highest, whole }) {
  if (values instanceof Uint8Array) return { size: 256, level: (n) => n, indices: (v) => v };
  if (values instanceof Int8Array) return { size: 256, level: (n) => (n << 24) >> 24, indices: (v) => new Uint8Array(v.buffer) };
  if (values instanceof Uint16Array) return { size: 65536, level: (n) => n, indices: (v) => v };
  if (values instanceof Int16Array) return { size: 65536, level: (n) => (n << 16) >> 16, indices: (v) => new Uint16Array(v.buffer) };
  const step = whole && highest - lowest < 65536 ? 1 : (highest - lowest || 1) / 65535;
  return { size: 65536, level: (n) => lowest + n * step, indices: (v) => Uint16Array.from(v, (one) => Math.round((one - lowest) / step)) };
}

/**
 * The table of gray levels: from black to white in the low byte, and 256 more where the level is within the bounds.
 * @param {{size: number, level: (n: number) => number}} scale
 * @param {{center: number, width: number}} contrast
 * @param {number} lower
 * @param {number} upper
 */
export function tonesOf(scale, { center, width }, lower, upper) {
  const tones = new Uint16Array(scale.size);
  const [start, slope] = [center - width / 2, 255 / Math.max(width, 1e-30)];
  for (let n = 0; n < scale.size; n++) {
    const level = scale.level(n);
    const tone = (level - start) * slope;
    tones[n] = (tone < 0 ? 0 : tone > 255 ? 255 : tone) | (level > lower && level <= upper ? 256 : 0);
  }
  return tones;
}

/** The table of colors over gray: a row of 256 for each component, for what was dropped, moves, or lies outside. @param {number} opacity */
export function mixOf(opacity) {
  const mix = new Uint32Array(ROWS * 256);
  for (let row = 0; row < ROWS; row++) {
    const [color, share] = over(row, opacity);
    for (let tone = 0; tone < 256; tone++) mix[row * 256 + tone] = packed(...color.map((one) => Math.round(one * share + tone * (1 - share))));
  }
  return mix;
}

function over(row, opacity) {
  if (row === 0) return [GRAY, 0];
  if (row === DROPPED) return [GRAY, 0.7 * opacity];
  if (row === OUTSIDE) return [[0, 0, 0], 1 - OUT_OF_BOX];
  return [rgb(colorOf(row === MOVING ? 1 : row)), opacity];
}

/** The table of a label map's colors; labels that are not chosen, where some are, are dark. @param {any} scale @param {Set<number>} chosen */
export function labelsOf(scale, chosen) {
  const table = new Uint32Array(scale.size);
  for (let n = 0; n < scale.size; n++) {
    const label = Math.round(scale.level(n));
    const shade = !chosen.size || chosen.has(label) ? 1 : 0.3;
    table[n] = label > 0 ? shaded(labelBytes(label % 360), shade) : packed(0, 0, 0);
  }
  return table;
}

const known = new Map();
const probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });

function labelBytes(label) {
  if (!known.has(label)) {
    probe.fillStyle = labelColor(label);
    probe.fillRect(0, 0, 1, 1);
    known.set(label, probe.getImageData(0, 0, 1, 1).data);
  }
  return known.get(label);
}

const shaded = ([r, g, b], shade) => packed(Math.round(r * shade), Math.round(g * shade), Math.round(b * shade));

/**
 * Paint a slice.
 * @param {Uint32Array} out a number a pixel
 * @param {{indices: any, layers: number}} slice
 * @param {Uint8Array | null} kept the components' numbers, null while they are not known
 * @param {Uint8Array | null} outside 1 where nothing is to be kept
 * @param {{tones: Uint16Array[], mix: Uint32Array, labels: Uint32Array | null, any: boolean}} tables
 */
export function paint(out, slice, kept, outside, tables) {
  if (tables.labels) paintLabels(out, slice, outside, tables.labels);
  else if (slice.layers > 1) paintColors(out, slice, kept, outside, tables);
  else paintGray(out, slice.indices, kept, outside, tables.tones[0], tables.mix);
}

function paintGray(out, indices, kept, outside, tones, mix) {
  for (let n = 0; n < out.length; n++) {
    const tone = tones[indices[n]];
    const row = outside && outside[n] ? OUTSIDE : kept ? kept[n] || (tone > 255 ? DROPPED : 0) : tone > 255 ? MOVING : 0;
    out[n] = mix[(row << 8) | (tone & 255)];
  }
}

function paintLabels(out, slice, outside, labels) {
  for (let n = 0; n < out.length; n++) {
    const color = labels[slice.indices[n]];
    out[n] = outside && outside[n] ? ((color >>> 2) & 0x3f3f3f) | 0xff000000 : color;
  }
}

function paintColors(out, { indices, layers }, kept, outside, { tones, mix, any }) {
  for (let n = 0; n < out.length; n++) {
    const first = n * layers;
    let inside = 0;
    for (let layer = 0; layer < layers; layer++) inside += tones[layer][indices[first + layer]] >> 8;
    const held = any ? inside > 0 : inside === layers;
    const row = outside && outside[n] ? OUTSIDE : kept ? kept[n] || (held ? DROPPED : 0) : held ? MOVING : 0;
    let color = 0xff000000;
    for (let layer = 0; layer < 3 && layer < layers; layer++) {
      color |= mix[(row << 8) | (tones[layer][indices[first + layer]] & 255)] & (255 << (8 * layer));
    }
    out[n] = color;
  }
}

/**
 * Paint a label map over a slice: the outline of each label in its color, and what is kept of those that are chosen.
 * @param {Uint32Array} out the slice as it was painted
 * @param {{map: any, columns: number, kept: Uint8Array | null, outside: Uint8Array | null}} slice
 * @param {{chosen: Set<number>, opacity: number}} over
 */
export function paintOver(out, { map, columns, kept, outside }, { chosen, opacity }) {
  let [label, color, held] = [0, packed(...rgb(COLORS[0])), false];
  for (let n = 0; n < out.length; n++) {
    if (map[n] !== label) {
      label = map[n];
      color = label > 0 ? shaded(labelBytes(Math.round(label) % 360), 1) : packed(...rgb(COLORS[0]));
      held = chosen.has(Math.round(label));
    }
    const rim = label > 0 && (map[n - 1] !== label || map[n + 1] !== label || map[n - columns] !== label || map[n + columns] !== label);
    if (rim) out[n] = color;
    else if (outside && outside[n]) continue;
    else if (held) out[n] = blended(out[n], !kept || kept[n] ? color : DROPPED_COLOR, opacity);
    else if (chosen.size && kept && kept[n]) out[n] = blended(out[n], color, opacity); // filled between labels
  }
}

function blended(below, above, share) {
  const mixed = (bits) => Math.round(((below >>> bits) & 255) * (1 - share) + ((above >>> bits) & 255) * share) << bits;
  return ((255 << 24) | mixed(16) | mixed(8) | mixed(0)) >>> 0;
}
