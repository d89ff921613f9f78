/** What was measured: problems first, each with its place, and every number, to be searched. */
import { el, fill, short } from "./dom.js";

const MARKS = { problem: "!", warning: "?", note: "i" };

/**
 * List what a user should know; a click on what has a place goes there.
 * @param {{matters: string, text: string, place: number[]|null, radius: number}[]} problems
 * @param {(one: any) => void} go
 */
export function problemList(problems, go) {
  if (!problems.length) return el("p", { class: "fine" }, "No problems: closed, manifold, and no face passes through another.");
  const rows = problems.map((one) => {
    const text = [el("b", { class: `matters ${one.matters}`, title: one.matters }, MARKS[one.matters]), ` ${one.text}`];
    const what = one.place ? el("button", { type: "button", class: "plain", onclick: () => go(one) }, ...text) : el("span", {}, ...text);
    const where = one.place ? el("small", { class: "muted" }, ` at ${one.place.map((x) => short(x, 4)).join(", ")}`) : null;
    return el("li", {}, what, where);
  });
  return el("ul", { class: "problems", "aria-label": "What to know of this surface" }, ...rows);
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
