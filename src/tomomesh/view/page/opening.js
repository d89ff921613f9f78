/** What may be opened, the series of a folder, and why a study was refused. */
import { get, post } from "./api.js";
import { el, fill, short } from "./dom.js";
import { choose, state, trying } from "./store.js";

const VALUES = { "--spacing": "spacing", "--spacing-z": "spacing_z" };

/** The page before a study is open. @returns {{element: HTMLElement, show: () => Promise<void>}} */
export function makeOpening() {
  const element = el("div", { class: "opening" });
  let asked = 0;
  const show = async () => {
    const turn = ++asked;
    const { opened } = state;
    if (!element.children.length) fill(element, el("p", {}, "..."));
    const [files, series] = await Promise.all([trying(get("/api/files")), trying(get("/api/series"))]);
    if (turn === asked) fill(element, ...refused(opened), ...seriesTable(series), ...segments(series), ...fileTable(files));
  };
  return { element, show };
}

function refused({ name, refused: line, flags }) {
  if (!line) return [];
  const helps = flags.filter((flag) => flag !== "--series" && flag !== "--select").map(helping);
  return [el("h2", {}, `${name} cannot be read as it is`), el("p", { class: "refused" }, line), ...helps];
}

/** What makes a study readable: a button, or a field where only the user knows the number. */
function helping(flag) {
  const name = flag.slice(2).replaceAll("-", "_");
  if (!VALUES[flag]) return el("p", {}, el("button", { type: "button", class: "first", onclick: () => choose({ [name]: true }) }, `Read it with ${flag}`));
  const count = flag === "--spacing" ? 3 : 1;
  const fields = Array.from({ length: count }, (_, n) => el("input", { type: "number", min: 0, step: "any", required: true, "aria-label": `${flag}, ${"XYZ"[count === 1 ? 2 : n]} in mm` }));
  const send = (event) => {
    event.preventDefault();
    const values = fields.map((one) => Number(one.value));
    choose({ [name]: count === 1 ? values[0] : values });
  };
  return el("form", { class: "fields", onsubmit: send }, flag, ...fields, "mm", el("button", { class: "first" }, "Read it so"));
}

function seriesTable(found) {
  if (!found?.series.length) return [];
  const heads = ["series", "modality", "slices", "rows x columns", "pixel mm", "apart mm", "description", ""];
  const left = Object.entries(found.left_out).map(([reason, count]) => `${count} ${reason}`).join(", ");
  return [el("h2", {}, "Series"),
    el("table", { class: "series" }, el("thead", {}, el("tr", {}, ...heads.map((one) => el("th", { scope: "col" }, one)))), el("tbody", {}, ...found.series.map((one) => seriesRow(one, found.series.length > 1)))),
    left ? el("p", { class: "hint" }, `Left out: ${left}.`) : null];
}

function seriesRow(one, several) {
  const open = several && el("button", { type: "button", class: one.refused ? "" : "first", onclick: () => choose({ series: one.number }) }, one.refused ? "Try" : "Open");
  const cells = [one.number, one.modality, one.slices, `${one.rows} x ${one.columns}`, pair(one.pixel_mm, " x "), pair(one.distances_mm, " to "), one.description || ""];
  const row = el("tr", {}, ...cells.map((cell) => el("td", {}, cell)), el("td", {}, open));
  if (one.refused) row.children[6].append(el("div", { class: "refused" }, one.refused.error));
  return row;
}

function pair(values, between) {
  if (!values) return "";
  const [low, high] = values;
  return Math.abs(high - low) <= 1e-3 * Math.abs(low) ? short(low) : `${short(low)}${between}${short(high)}`;
}

function segments(found) {
  const rows = Object.entries(found?.segments || {});
  if (!rows.length) return [];
  return [el("h2", {}, "Segments"), el("div", { class: "chips" }, ...rows.map(([number, name]) => el("button", { type: "button", onclick: () => choose({ select: [Number(number)] }) }, `${number} ${name}`)))];
}

function fileTable(found) {
  const rows = found?.files || [];
  if (!rows.length) return found?.browses ? [el("p", {}, "The folder holds no studies, points or meshes.")] : nothing();
  if (rows.length === 1 && !found.browses) return [];
  const open = ({ path, series }) => trying(post("/api/open", { path, series }));
  return [el("h2", {}, "Files"), el("table", { class: "series" }, el("tbody", {}, ...rows.map((one) => el("tr", {},
    el("td", {}, one.name), el("td", {}, one.kind), el("td", {}, el("button", { type: "button", onclick: () => open(one) }, "Open")))))) ];
}

const nothing = () => (state.opened.kind === "nothing" ? [el("h2", {}, "Nothing is open"), el("p", {}, "Name a study, points or a mesh on the command line, as ", el("code", {}, "tomomesh view STUDY"), ", or a folder of them: ", el("code", {}, "tomomesh view --browse FOLDER"), ".")] : []);
