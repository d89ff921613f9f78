/** What is beside the network: where the player stands, the curves, the maps of a sheet. */
import { get } from "./api.js";
import { curve } from "./curves.js";
import { fill } from "./dom.js";
import { drawMaps } from "./network-maps.js";
import { ofFrame } from "./network-words.js";
import { trying } from "./store.js";

const SHEETS = ["grid", "hexagonal", "cylinder", "torus"];
let mapped = "";

/** Show where a training stands. @param {any} at the elements @param {any} course @param {any} play the player @param {boolean} trained whether there is a training to go back to */
export function showSide(at, course, play, trained) {
  const frames = course ? course.frames : [];
  const now = frames[play.at];
  at.frames.max = String(Math.max(frames.length - 1, 0));
  at.frames.value = String(Math.max(play.at, 0));
  at.frames.disabled = at.back.disabled = at.forth.disabled = !now;
  at.toggle.disabled = !trained;
  at.toggle.textContent = play.playing ? "Pause" : "Play";
  at.player.dataset.shown = now ? String(now.n) : "";
  at.step.textContent = now ? ofFrame(course, now) : "";
  at.title.textContent = course ? `${course.title}: ${course.topology} of ${course.neurons} neurons, ${course.inputs.toLocaleString("en")} input${course.inputs === 1 ? "" : "s"}` : at.source.value === "slice" ? `Slice ${at.slice.value} of the study` : "";
  at.curves.hidden = at.maps.hidden = trained && !course;
  at.saving.hidden = !course || course.state === "running";
  curves(at, course, play, frames.slice(0, play.at + 1).filter(Boolean));
  maps(at, course, play, now);
}

function curves(at, course, play, frames) {
  if (!course || !frames.length) return;
  const steps = frames.map(({ n }) => stepOf(course, n));
  const along = course.training === "online" ? "presentations" : "epochs";
  const last = course.state === "running" ? course.steps[course.steps.length - 1] : stepOf(course, course.frames.length - 1);
  const drawn = [["error", `Error${course.unit ? ` (${course.unit})` : ""}`], ["radius", "Radius (hops)"], ["alpha", "Alpha"]];
  fill(at.curves, ...drawn.map(([key, name]) => curve({ name, along, steps, values: frames.map((one) => one[key]), at: play.at, last, go: play.seek })));
}

/** Where a frame lies on the axis: online, what follows the presentations is drawn one epoch's share beyond. */
function stepOf({ steps, training }, n) {
  const beyond = n - steps.length + 1;
  if (beyond <= 0) return steps[n];
  return steps[steps.length - 1] + beyond * (training === "online" ? steps[steps.length - 1] / 60 : 1);
}

async function maps(at, course, play, now) {
  const shown = course && now && SHEETS.includes(course.topology) && !play.playing ? `${now.n}` : "";
  if (shown === mapped) return;
  mapped = shown;
  if (!course) return;
  if (!SHEETS.includes(course.topology)) return fill(at.maps);
  if (!shown) return;
  const told = await trying(get(`/api/training/maps/${shown}`));
  if (told && mapped === shown) fill(at.maps, ...drawMaps(told));
}
