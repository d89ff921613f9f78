/** The page: its parts as tabs, the work that is underway, undo, and the command line that repeats it all. */
import { el, fill } from "./dom.js";
import { begin, on, redo, state, stop, tell, undo } from "./store.js";
import * as networks from "./networks.js";
import * as saving from "./saving.js";
import * as study from "./study.js";
import * as surface from "./surface.js";

/** Each has `title`, `keys` ([key, what it does]), `applies(kind, opened)`, and `mount(panel)`, which returns {show, hide, key}. */
const PARTS = { study, networks, surface, saving };
const THEMES = ["auto", "light", "dark"];
const shown = new Map();
/** Milliseconds of work that is not shown: the page would only twitch. */
const SHORT = 300;
let current = "";
let working = 0;
let settled = "";

const byId = (id) => /** @type {any} */ (document.getElementById(id));

function mountAll() {
  for (const [name, part] of Object.entries(PARTS)) {
    const panel = el("section", { id: name, class: "panel", role: "tabpanel", "aria-labelledby": `tab-${name}`, hidden: true });
    const tab = el("button", { id: `tab-${name}`, type: "button", role: "tab", hidden: true, "aria-controls": name, onclick: () => open(name) }, part.title);
    byId("tabs").append(tab);
    byId("panels").append(panel);
    shown.set(name, { panel, tab, ...part.mount(panel) });
  }
}

function open(name) {
  if (!shown.has(name) || name === current) return;
  if (current) shown.get(current).hide();
  current = name;
  for (const [other, { panel, tab }] of shown) {
    panel.hidden = other !== name;
    tab.setAttribute("aria-selected", String(other === name));
  }
  shown.get(name).show();
}

function showState(now) {
  const settles = JSON.stringify([now.opened.turn, now.choices]);
  if (settles !== settled) byId("said").querySelectorAll(".fault").forEach((one) => one.remove()); // it was put right
  settled = settles;
  byId("opened").textContent = now.opened.name;
  byId("undo").disabled = !now.undo;
  byId("redo").disabled = !now.redo;
  byId("command").textContent = now.command;
  byId("command").parentElement.hidden = !now.command;
  for (const [name, { tab }] of shown) tab.hidden = !PARTS[name].applies(now.opened.kind, now.opened);
  if (!current && now.opened.kind === "nothing" && !now.opened.browses) open("networks"); // a class needs no study
  if (!current || shown.get(current).tab.hidden) open([...shown.keys()].find((name) => !shown.get(name).tab.hidden));
  if (now.job) showWork(now.job);
  else hideWork();
}

function showWork(job) {
  working ||= setTimeout(() => (byId("work").hidden = false), SHORT);
  byId("work-name").textContent = job.stopping ? `${job.name}: stopping ...` : `${job.name}${job.stage ? `: ${job.stage}` : ""}`;
  byId("work-stop").disabled = job.stopping;
  const bar = byId("work-bar");
  if (job.total > 1) {
    bar.max = job.total;
    bar.value = job.done;
  } else bar.removeAttribute("value");
}

function hideWork() {
  clearTimeout(working);
  working = 0;
  byId("work").hidden = true;
}

function say(line, kind) {
  const closed = el("button", { type: "button", "aria-label": "Close", onclick: () => note.remove() }, "×");
  const note = el("p", { class: `toast ${kind}` }, line, closed);
  byId("said").append(note);
  if (kind !== "fault") setTimeout(() => note.remove(), 6000);
  while (byId("said").children.length > 4) byId("said").firstElementChild.remove();
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  tell("theme", { theme });
}

function showKeys() {
  const general = [["Ctrl+Z, Ctrl+Y", "undo, redo"], ["1 to 4", "the parts of the page"], ["D", "light or dark"], ["?", "these keys"]];
  const rows = [...general, ...PARTS[current].keys].map(([key, what]) => el("tr", {}, el("th", {}, key), el("td", {}, what)));
  const closed = el("button", { type: "button", onclick: () => byId("keys").close() }, "Close");
  fill(byId("keys"), el("h2", { id: "keys-title" }, "Keys"), el("table", {}, ...rows), closed);
  byId("keys").showModal();
}

function onKey(event) {
  const typing = event.target.closest("input:not([type=range]):not([type=checkbox]), textarea, select, dialog");
  if (typing) return;
  const command = event.ctrlKey || event.metaKey;
  const visible = [...shown].filter(([, one]) => !one.tab.hidden).map(([name]) => name);
  if (command && event.key.toLowerCase() === "z" && !event.shiftKey) undo();
  else if (command && (event.key.toLowerCase() === "y" || event.key.toLowerCase() === "z")) redo();
  else if (command || event.altKey) return;
  else if (event.key >= "1" && event.key <= "9") open(visible[Number(event.key) - 1]);
  else if (event.key.toLowerCase() === "d") nextTheme();
  else if (event.key === "?") showKeys();
  else if (!shown.get(current)?.key?.(event)) return;
  event.preventDefault();
}

function nextTheme() {
  const now = document.documentElement.dataset.theme || "auto";
  setTheme(THEMES[(THEMES.indexOf(now) + 1) % THEMES.length]);
}

async function copyCommand() {
  await navigator.clipboard.writeText(state.command).then(() => say("copied", "done"), () => say("select it, and copy it", "fault"));
}

mountAll();
byId("undo").onclick = undo;
byId("redo").onclick = redo;
byId("theme").onclick = nextTheme;
byId("help").onclick = showKeys;
byId("copy").onclick = copyCommand;
byId("work-stop").onclick = stop;
addEventListener("keydown", onKey);
on("state", showState);
on("progress", showWork);
on("done", hideWork);
on("stopped", () => { hideWork(); say("stopped", "done"); });
/** Parts that say themselves what some work has failed by. */
const SAYING = { reconstruct: "surface", read: "study" };
on("failed", ({ name, error }) => { hideWork(); if (SAYING[name] !== current) say(error, "fault"); });
on("fault", ({ line }) => say(line, "fault"));
on("away", () => document.body.classList.add("away"));
on("back", () => document.body.classList.remove("away"));
begin();
