/** What is kept, component by component; or the labels of a label map. A click keeps or drops, as far as the options go. */
import { el, fill } from "./dom.js";
import { goTo, isLabels, looked } from "./looked.js";
import { colorOf, labelColor } from "./painting.js";
import { choose, state } from "./store.js";

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
    title.textContent = isLabels() ? "Labels" : "Kept";
    fill(list, ...(isLabels() ? labelRows() : componentRows()));
    fill(doubts, ...(looked.kept?.warnings || []).map((line) => el("li", {}, line)));
    if (looked.kept) say(inWords(looked.kept));
  };
  return { element, show, say };
}

function inWords({ window, count }) {
  const parts = [`${counted(window.voxels)} voxels, ${(100 * window.share).toPrecision(2)} %, in ${count === 1 ? "one component" : `${count} components`}`];
  if (window.dropped_components) parts.push(`${window.dropped_components} left out (gray)`);
  if (window.specks) parts.push(`${window.specks} specks left out`);
  if (window.filled_pores) parts.push(`${window.filled_pores} pores filled`);
  return `${parts.join("; ")}.`;
}

const counted = (number) => (number >= LARGE ? Intl.NumberFormat("en", { notation: "compact", maximumSignificantDigits: 3 }).format(number) : String(number));
const volume = (mm3) => (mm3 >= 1000 ? `${Number((mm3 / 1000).toPrecision(3))} cm³` : `${Number(mm3.toPrecision(3))} mm³`);

function colored(element, color) {
  element.style.setProperty("--color", color);
  return element;
}

function componentRows() {
  return (looked.kept?.components || []).map((one) => el("div", { class: "row" },
    el("button", { type: "button", class: "name", title: "Lead the crosshair there", onclick: () => goTo(one.inside) },
      colored(el("span", { class: "swatch" }), colorOf(one.number)), ` ${one.number}: ${volume(one.volume_mm3)}`),
    looked.kept.count > 1 && el("button", { type: "button", title: onlyTitle(one), onclick: () => only(one) }, "only this")));
}

const onlyTitle = (one) => (one.number === 1 ? "--keep largest" : "--keep largest, in a box around it (--roi)");

/** Keep one component: the largest of all, or of a box around it. */
function only(one) {
  choose(one.number === 1 ? { keep: "largest" } : { keep: "largest", roi: one.roi });
}

/** Take a click on a component: another than the largest is dropped, and what was dropped is kept. @param {number} number 0 for none @param {boolean} inWindow @param {(line: string) => void} say */
export function pickComponent(number, inWindow, say) {
  const keep = state.choices.keep || "auto";
  if (number > 1 && keep !== "largest") choose({ keep: "largest" });
  else if (number === 1 && looked.kept.count > 1) choose({ keep: "largest" });
  else if (!number && inWindow && keep !== "all") choose({ keep: "all" });
  else say(number ? "There is no other component to drop." : "Nothing of the window is here.");
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
    el("span", { class: "name" }, `${label} ${names[label] || ""}`), el("small", {}, counted(voxels))));
}
