/** What was measured: problems first, each with its place, and every number, to be searched. */
import { el, fill, short } from "./dom.js";

const MARKS = { problem: "!", warning: "?", note: "i" };

/**
 * Say whether the surface is good to use, and list what a user should know of it; a click on what has places goes
 * there, from one to the next.
 * @param {{state: string, words: string}} verdict
 * @param {{matters: string, text: string, places: [number[], number][]}[]} problems
 * @param {(place: number[], radius: number) => void} go
 */
export function problemList(verdict, problems, go) {
  const words = el("p", { class: `verdict ${verdict.state}` }, verdict.words);
  return [words, problems.length > 0 && el("ul", { class: "problems", "aria-label": "What to know of this surface" }, ...problems.map((one) => problemRow(one, go)))];
}

function problemRow({ matters, text, places }, go) {
  const words = [el("b", { class: `matters ${matters}`, title: matters }, MARKS[matters]), ` ${text}`];
  if (!places.length) return el("li", {}, el("span", {}, ...words));
  const where = el("small", { class: "muted", role: "status" });
  let at = -1;
  const step = (by) => {
    at = (at + by + places.length) % places.length;
    const [place, radius] = places[at];
    where.textContent = ` ${places.length > 1 ? `${at + 1} of ${places.length}, ` : ""}at ${place.map((x) => short(x, 4)).join(", ")}`;
    go(place, radius);
  };
  const stepping = (sign, name, by) => el("button", { type: "button", class: "step", "aria-label": name, title: name, onclick: () => step(by) }, sign);
  const several = places.length > 1 && [stepping("‹", "the place before", -1), stepping("›", "the next place", 1)];
  return el("li", {}, el("button", { type: "button", class: "plain", onclick: () => step(1) }, ...words), ...(several || []), where);
}

/**
 * Show a report as one table that can be searched.
 * @param {Record<string, any>} report
 */
export function reportTable(report) {
  const rows = [...flat(report)].map(([name, value]) => ({ name, text: inWords(value) }));
  const body = el("tbody");
  const search = el("input", { type: "search", placeholder: "Search the report", "aria-label": "Search the report", oninput: draw });
  function draw() {
    const asked = search.value.trim().toLowerCase();
    const found = rows.filter(({ name, text }) => `${name} ${text}`.toLowerCase().includes(asked));
    fill(body, ...found.map(({ name, text }) => el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, text))));
  }
  draw();
  return el("details", { class: "report", open: true }, el("summary", {}, "Report"), search, el("table", {}, body));
}

function* flat(value, name = "") {
  if (value === null || typeof value !== "object" || Array.isArray(value)) yield [name, value];
  else for (const [key, one] of Object.entries(value)) yield* flat(one, name ? `${name}.${key}` : key);
}

function inWords(value) {
  if (typeof value === "number") return short(value, 6);
  if (value !== null && typeof value === "object" && !Array.isArray(value)) return Object.entries(value).map(([name, one]) => `${name} ${inWords(one)}`).join(", ");
  if (!Array.isArray(value)) return String(value ?? "-");
  const first = value.slice(0, 8).map(inWords).join(", ");
  return value.length > 8 ? `${first}, ... (${value.length})` : first || "none";
}
