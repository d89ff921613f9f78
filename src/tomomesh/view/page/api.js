/** Ask the server: every answer is JSON or numbers, every fault is one line. */

/** A fault that the server has told: one line, and the options that may help. */
export class Refused extends Error {
  /** @param {string} line @param {string[]} flags */
  constructor(line, flags = []) {
    super(line);
    this.flags = flags;
  }
}

/**
 * Ask a question.
 * @param {string} path
 * @param {Record<string, string|number>} [query]
 * @param {AbortSignal} [signal]
 * @returns {Promise<any>}
 */
export async function get(path, query = {}, signal = undefined) {
  return (await answered(address(path, query), { signal })).json();
}

/**
 * Have something done.
 * @param {string} path
 * @param {object} [body]
 * @returns {Promise<any>}
 */
export async function post(path, body = {}) {
  const sent = { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) };
  return (await answered(path, sent)).json();
}

const ARRAYS = { u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array, i4: Int32Array, f4: Float32Array, f8: Float64Array };

/**
 * Fetch numbers.
 * @param {string} path
 * @param {Record<string, string|number>} [query]
 * @param {AbortSignal} [signal]
 * @returns {Promise<{values: any, shape: number[], headers: Headers}>}
 */
export async function numbers(path, query = {}, signal = undefined) {
  const answer = await answered(address(path, query), { signal });
  const kind = ARRAYS[/** @type {keyof ARRAYS} */ (answer.headers.get("x-dtype"))];
  const shape = (answer.headers.get("x-shape") || "").split(",").filter(Boolean).map(Number);
  return { values: new kind(await answer.arrayBuffer()), shape, headers: answer.headers };
}

function address(path, query) {
  const words = new URLSearchParams(Object.entries(query).map(([name, value]) => [name, String(value)]));
  return words.size ? `${path}?${words}` : path;
}

async function answered(path, options) {
  const answer = await fetch(path, options);
  if (answer.ok) return answer;
  const told = await answer.json().catch(() => ({}));
  throw new Refused(told.error || `the server has answered ${answer.status}`, told.flags);
}
