/** What is kept, component by component; or the labels of a label map. A click leaves out, or brings back. */
import { el, fill } from "./dom.js";
import { goTo, isLabels, looked } from "./looked.js";
import { colorOf, labelColor } from "./painting.js";
import { choose, pick, state } from "./store.js";

const LARGE = 1000;

/** The section of the panel. @returns {{element: HTMLElement, show: () => void, say: (line: string, kind?: string) => void}} */
export function makeKeeping() {
  const title = el("h2", {});
  const told = el("p", { class: "told", role: "status" });
  const list = el("div", { class: "rows" });
  const doubts = el("ul", { class: "doubts" });
  const element = el("section", { class: "part grows" }, title, told, list, doubts);
  const say = (line, kind = "") => {
    told.textContent = line;
    told.className = `told ${kind}`;
  };
  const show = () => {
    const labelled = looked.geometry?.labelled && looked.survey;
    title.textContent = isLabels() || labelled ? "Labels" : "Kept";
    fill(list, ...(isLabels() || labelled ? labelRows() : []), ...(isLabels() ? [] : componentRows()));
    fill(doubts, ...(looked.kept?.warnings || []).map((line) => el("li", {}, line)));
    if (looked.kept) say(inWords(looked.kept));
  };
  return { element, show, say };
}

function inWords({ window, count }) {
  const parts = [`${counted(window.voxels)} voxels, ${(100 * window.share).toPrecision(2)} %, in ${count === 1 ? "one component" : `${count} components`}`];
  if (window.dropped_components) parts.push(`${window.dropped_components} left out (gray)`);
  if (window.left_out_components) parts.push(`${window.left_out_components} left out by place`);
  if (window.specks) parts.push(`${window.specks} ${window.specks === 1 ? "speck" : "specks"} left out`);
  if (window.filled_pores) parts.push(`${window.filled_pores} ${window.filled_pores === 1 ? "pore" : "pores"} filled`);
  return `${parts.join("; ")}.`;
}

const counted = (number) => (number >= LARGE ? Intl.NumberFormat("en", { notation: "compact", maximumSignificantDigits: 3 }).format(number) : String(number));
const volume = (mm3) => (mm3 >= 1000 ? `${Number((mm3 / 1000).toPrecision(3))} cm³` : `${Number(mm3.toPrecision(3))} mm³`);

function colored(element, color) {
  element.style.setProperty("--color", color);
  return element;
}

function componentRows() {
  const several = looked.kept?.count > 1;
  const kept = (looked.kept?.components || []).map((one) => el("div", { class: "row" },
    el("button", { type: "button", class: "name", title: "Lead the crosshair there", onclick: () => goTo(one.inside) },
      state.choices.select ? null : colored(el("span", { class: "swatch" }), colorOf(one.number)), ` ${one.number}: ${volume(one.volume_mm3)}`),
    several && el("button", { type: "button", title: "--keep-at a place in it", onclick: () => choose({ keep_at: [one.place], drop_at: null }) }, "only this"),
    several && el("button", { type: "button", title: "--drop-at a place in it", onclick: () => pick(one.inside) }, "leave out")));
  return [...kept, ...pickedRows("keep_at", "the one at", "not alone"), ...pickedRows("drop_at", "not the one at", "bring back")];
}

/** What was picked by places, each to be taken back. */
function pickedRows(name, words, back) {
  const places = state.choices[name] || [];
  const without = (place) => places.filter((one) => one !== place);
  return places.map((place) => el("div", { class: "row picked" }, el("span", { class: "name" }, `${words} ${place.join(", ")}`),
    el("button", { type: "button", onclick: () => choose({ [name]: without(place).length ? without(place) : null }) }, back)));
}

/** Take a click on a voxel: its component is left out, or brought back. @param {number[]} voxel @param {boolean} held whether it is kept @param {boolean} inWindow @param {(line: string, kind?: string) => void} say */
export function pickComponent(voxel, held, inWindow, say) {
  const picked = state.choices.keep_at || state.choices.drop_at;
  if (held || (inWindow && picked)) pick(voxel);
  else if (inWindow && (state.choices.keep || "auto") !== "all") choose({ keep: "all" });
  else say("Nothing of the window is here.");
}

/** Take a click on a label: it is chosen, or no more. @param {number} label */
export function pickLabel(label) {
  if (!(label > 0)) return;
  const chosen = new Set(state.choices.select || []);
  if (!chosen.delete(label)) chosen.add(label);
  const select = chosen.size ? [...chosen].sort((a, b) => a - b) : null;
  choose({ select, ...(select ? { lower: null, upper: null, preset: null } : {}) });
}

function labelRows() {
  const { labels, label_names: names } = looked.survey;
  const chosen = new Set(state.choices.select || []);
  return Object.entries(labels).map(([label, voxels]) => el("label", { class: "row" },
    el("input", { type: "checkbox", ...(chosen.has(Number(label)) ? { checked: true } : {}), onchange: () => pickLabel(Number(label)) }),
    colored(el("span", { class: "swatch" }), labelColor(Number(label))),
    el("span", { class: "name" }, `${label} ${names[label] || ""}`), el("small", {}, voxels === null ? "" : counted(voxels))));
}
