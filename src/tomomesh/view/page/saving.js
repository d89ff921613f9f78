/** What leaves the page: files as the command line writes them, and the command line itself. */
import { get } from "./api.js";
import { el, fill } from "./dom.js";
import { on, state, trying } from "./store.js";

export const title = "Save";
export const keys = [];
export const applies = (kind) => ["study", "points", "mesh"].includes(kind);

const WHAT = {
  mesh: ["The mesh", "closed; of a study in patient millimeters unless --frame says otherwise"],
  points: ["The points", "neurons, bridged gaps and caps"],
  mask: ["The voxels inside the mesh", "a label map on the study's own grid"],
  labels: ["The regions of the networks", "a label map on the study's own grid"],
  report: ["The report", "as a page that opens anywhere (html), or its numbers (json)"],
  settings: ["The settings", "for --settings, to repeat or to hand on"],
};

/** @param {HTMLElement} panel */
export function mount(panel) {
  panel.classList.add("saving");
  const list = el("div", { class: "saves" });
  const hint = el("p", { class: "muted" });
  const command = el("pre", { class: "whole", tabindex: 0, "aria-label": "The command line that repeats this" });
  fill(panel, el("h2", {}, "Files"), hint, list, el("h2", {}, "The same from a terminal"), command,
    el("p", { class: "muted" }, "This command gives the same bytes as the mesh that is saved here."));

  async function show() {
    const formats = await trying(get("/api/formats"));
    if (!formats) return;
    const shown = Object.entries(WHAT).filter(([what]) => state.opened.kind !== "mesh" || what in formats);
    fill(list, ...shown.map(([what, words]) => line(what, words, formats[what])));
    update();
  }

  function update() {
    if (!state) return;
    command.textContent = state.saving;
    const stale = state.made.reconstruct === false;
    hint.textContent = state.opened.kind === "mesh" ? "A closed mesh is written in another format, its frame and unit named where the format can." : !("reconstruct" in state.made) ? "There is no surface yet: make it in the part Surface." : stale ? "Choices have changed since the surface was made: files are of the surface that is shown." : "";
  }

  on("state", () => { update(); if (!panel.hidden) show(); });
  return { show, hide() {}, key: () => false };
}

function line(what, [name, about], formats) {
  const kinds = el("select", { "aria-label": `Format of ${name.toLowerCase()}`, disabled: !formats || formats.length < 2 },
    ...(formats || []).map((suffix) => el("option", { value: suffix }, suffix.slice(1))));
  const save = el("button", { type: "button", disabled: !formats, onclick: () => saved(save, `${what}${kinds.value}`) }, "Save");
  return el("div", { class: "save" }, el("div", {}, el("strong", {}, name), el("br"), el("span", { class: "muted" }, about)), kinds, save);
}

/** Save, and let nobody ask for it twice meanwhile. */
async function saved(button, name) {
  button.disabled = true;
  await download(name);
  button.disabled = false;
}

async function download(name) {
  const answer = await trying(fetch(`/save/${name}`).then(fileOf));
  if (!answer) return;
  const link = el("a", { href: URL.createObjectURL(answer), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

async function fileOf(answer) {
  if (answer.ok) return answer.blob();
  throw new Error((await answer.json()).error);
}
