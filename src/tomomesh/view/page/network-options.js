/** A form of parameters, made of their schema: with help, unit and limits, and only those that matter. */
import { el, fill } from "./dom.js";
import { choose as chosen, state, tell } from "./store.js";

/** Names of parameters as a class reads them. */
const CALLED = {
  way: "Way to the surface", network: "Topology", neurons: "Neurons", signal: "Signal", training: "Training", epochs: "Epochs", iterations: "Presentations",
  start: "Start", neighborhood: "Neighborhood", radius: "Radius, first, last", radius_fall: "Fall of the radius", radius_power: "Power of its fall",
  alpha: "Alpha, first, last", alpha_fall: "Fall of alpha", alpha_power: "Power of its fall", least_move: "Least move", trim: "Strays beyond",
  even: "Spaced evenly", bridge: "Bridge over", inputs: "Color pixels", seed: "Seed",
};
/** Values that are no choice here: nothing is trained then. */
const NOT_HERE = { network: ["none"] };
const open = new Set();

/** What the form shows: while nothing of it changes, it is left alone, with what is being typed. */
let filled = "";

/** Choose; what is refused is shown as it was. @param {Record<string, any>} changes */
async function choose(changes) {
  if (await chosen(changes)) return;
  filled = "";
  tell("state", state);
}

/** Gather the schemas of all parameters by their bare names. @param {any} schema */
export function parametersOf(schema) {
  return Object.assign({}, ...Object.values(schema.properties).map((group) => group.properties));
}

/** What a parameter is now: as chosen, else the paper's where all is by the paper, else its default. */
export function valueOf(name, entry) {
  const own = state.choices[name];
  if (own !== undefined) return own;
  return state.choices.way === "paper" && entry.paper !== undefined ? entry.paper : entry.default;
}

/**
 * Fill a form.
 * @param {Element} form
 * @param {Record<string, any>} parameters
 * @param {string[]} names
 */
export function fillOptions(form, parameters, names) {
  const now = JSON.stringify(names.map((name) => [name, valueOf(name, parameters[name]), state.choices[name]]));
  if (now === filled) return;
  filled = now;
  const focused = document.activeElement && document.activeElement.id;
  fill(form, ...names.map((name) => row(name, parameters[name])));
  if (focused && form.contains(document.getElementById(focused))) document.getElementById(focused).focus();
}

function row(name, entry) {
  const id = `option-${name}`;
  const help = el("p", { id: `${id}-help`, class: "net-help", hidden: !open.has(name) }, `${entry.description}${limits(entry)}.`);
  const asked = el("button", { type: "button", class: "net-asked", "aria-expanded": open.has(name), "aria-controls": help.id, "aria-label": `What is ${CALLED[name]}?`, onclick: () => toggle(name, help, asked) }, "?");
  const label = el("label", { for: id, title: entry.description }, CALLED[name], unit(name, entry));
  const own = state.choices[name] !== undefined;
  return el("div", { class: `net-option${own ? " chosen" : ""}` }, label, el("span", { class: "net-value" }, ...control(id, name, entry)), asked, help);
}

function toggle(name, help, asked) {
  if (!open.delete(name)) open.add(name);
  help.hidden = !open.has(name);
  asked.setAttribute("aria-expanded", String(open.has(name)));
}

const unit = (name, entry) => (entry.unit && entry.unit !== CALLED[name].toLowerCase() ? el("span", { class: "net-unit" }, ` ${entry.unit}`) : null);

function limits(entry) {
  const { minimum, maximum, exclusiveMinimum } = number(entry);
  const words = [[exclusiveMinimum, "over"], [minimum, "at least"], [maximum, "at most"]].filter(([value]) => value !== undefined);
  return words.length ? `; ${words.map(([value, word]) => `${word} ${value}`).join(", ")}` : "";
}

const kinds = (entry) => entry.anyOf || [entry];
const number = (entry) => kinds(entry).flatMap((one) => [one, one.items || {}]).find((one) => one.type === "number" || one.type === "integer") || {};

function control(id, name, entry) {
  const value = valueOf(name, entry);
  const choices = kinds(entry).find((one) => one.enum && one.enum.length > 1);
  if (choices) return [select(id, name, choices.enum, value)];
  if (entry.type === "boolean") return [el("input", { id, type: "checkbox", checked: value, onchange: (event) => choose({ [name]: event.target.checked }) })];
  const pair = kinds(entry).find((one) => one.type === "array");
  return pair ? two(id, name, entry, value) : [numberOf(id, entry, value, (given) => choose({ [name]: given }))];
}

function select(id, name, values, value) {
  const shown = values.filter((one) => !(NOT_HERE[name] || []).includes(one));
  const made = el("select", { id, onchange: (event) => choose({ [name]: event.target.value }) }, ...shown.map((one) => el("option", { value: one }, one)));
  made.value = shown.includes(value) ? value : shown[0];
  return made;
}

function numberOf(id, entry, value, change) {
  const { type, minimum, maximum } = number(entry);
  const changed = (event) => {
    const given = event.target.value.trim() === "" ? null : Number(event.target.value);
    change(given);
  };
  return el("input", { id, type: "number", min: minimum, max: maximum, step: type === "integer" ? 1 : "any", value, placeholder: "auto", onchange: changed });
}

function two(id, name, entry, value) {
  const now = value ? [...value] : [null, null];
  const change = (n) => (given) => {
    now[n] = given;
    if (now.every((one) => one === null)) choose({ [name]: null });
    else if (now.every((one) => one !== null)) choose({ [name]: now });
    fields.forEach((field, m) => Object.assign(field, { required: now[m] === null && now[1 - m] !== null, placeholder: now[1 - m] === null ? "auto" : "needed" }));
  };
  const fields = [numberOf(id, entry, now[0], change(0)), numberOf(`${id}-last`, entry, now[1], change(1))];
  fields[1].setAttribute("aria-label", `${CALLED[name]}: last`);
  return fields;
}
