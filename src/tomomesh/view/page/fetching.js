/** Slices from the server: the last ones are kept, neighbors are fetched ahead, and never the whole volume. */
import { numbers } from "./api.js";

/** Slices of one kind. */
export class Slices {
  /**
   * @param {string} path as "/slice"
   * @param {number} most how many are kept
   */
  constructor(path, most) {
    this.path = path;
    this.most = most;
    this.query = {};
    this.held = new Map();
    this.asked = new Map();
  }

  /** Forget all, and ask for others from now on. @param {Record<string, string>} [query] */
  restart(query = {}) {
    this.query = query;
    this.held.clear();
    this.asked.clear();
  }

  /** A slice that has come, or undefined. @param {string} plane @param {number} k */
  have(plane, k) {
    const name = `${plane}/${k}`;
    const found = this.held.get(name);
    if (found) {
      this.held.delete(name);
      this.held.set(name, found);
    }
    return found;
  }

  /** Fetch a slice. @param {string} plane @param {number} k @returns {Promise<any>} undefined where there is none any more */
  fetch(plane, k) {
    const name = `${plane}/${k}`;
    const found = this.have(plane, k);
    if (found) return Promise.resolve(found);
    if (!this.asked.has(name)) this.asked.set(name, this.#fetched(name, this.query));
    return this.asked.get(name);
  }

  async #fetched(name, query) {
    const found = await numbers(`${this.path}/${name}`, query).catch(() => undefined);
    if (query !== this.query) return undefined;
    this.asked.delete(name);
    if (found) this.held.set(name, found);
    if (this.held.size > this.most) this.held.delete(this.held.keys().next().value);
    return found;
  }
}
