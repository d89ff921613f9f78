/** What the page knows of the session: the server's state, and the events in which it tells of changes. */
import { get, post } from "./api.js";

/** @type {any} */
export let state = null;
const listeners = new Map();

/**
 * Be told of events: "state", "progress", "done", "failed", "stopped", "epoch", "fault", "away", "back".
 * @param {string} event
 * @param {(told: any) => void} listener
 * @returns {() => void} what ends that
 */
export function on(event, listener) {
  if (!listeners.has(event)) listeners.set(event, new Set());
  listeners.get(event).add(listener);
  return () => listeners.get(event).delete(listener);
}

/** Tell all that listen. @param {string} event @param {any} told */
export function tell(event, told = {}) {
  for (const listener of listeners.get(event) || []) listener(told);
}

/** Change parameters; null takes one back to its default. @param {Record<string, any>} changes */
export const choose = (changes) => changed(post("/api/choose", changes));

/** Leave out the component at a voxel, or bring it back. @param {number[]} voxel of the study, slice, row and column */
export const pick = (voxel) => changed(post("/api/pick", { voxel }));

export const undo = () => changed(post("/api/undo"));
export const redo = () => changed(post("/api/redo"));
/** Have the work end: events tell that it does, and none may be undone by the answer, which is older. */
export const stop = () => trying(post("/api/cancel"));

/**
 * Do what may be refused, and say so where it is.
 * @template T
 * @param {Promise<T>} asked
 * @returns {Promise<T | undefined>}
 */
export async function trying(asked) {
  try {
    return await asked;
  } catch (fault) {
    if (fault.name !== "AbortError") tell("fault", { line: fault.message, flags: fault.flags || [] });
    return undefined;
  }
}

async function changed(asked) {
  const now = await trying(asked);
  if (now) take(now);
  return now;
}

function take(now) {
  if (state && now.told < state.told) return;
  state = now;
  tell("state", now);
}

/** Begin: fetch the state, and listen to the server; a connection that is lost is made again. */
export async function begin() {
  const now = await trying(get("/api/state"));
  if (now) take(now);
  listen(500);
}

function listen(wait) {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/events`);
  let open = false;
  socket.onopen = () => {
    open = true;
    tell("back");
  };
  socket.onmessage = (message) => {
    const told = JSON.parse(message.data);
    if (told.event === "state") take(told.state);
    else hear(told);
  };
  socket.onclose = () => {
    tell("away");
    setTimeout(() => again(open ? 500 : Math.min(2 * wait, 8000)), wait);
  };
}

/** Pass an event on; the state knows of the work that is underway, and of its end, too. */
function hear(told) {
  if (state && told.event === "progress") state.job = told;
  else if (state && ["done", "stopped", "failed"].includes(told.event)) state.job = null;
  tell(told.event, told);
}

async function again(wait) {
  const now = await get("/api/state").catch(() => null);
  if (now) take(now);
  listen(wait);
}
