/** A training as it is received: in order, complete, and again where the page was opened anew. */
import { get, numbers } from "./api.js";
import { sliceOf } from "./network-backdrop.js";
import { trying } from "./store.js";

/**
 * Make what receives a training.
 * @param {(course: any) => void} grown is told when there are more frames, or no more will come
 * @param {() => void} begun is told when another training has begun
 */
export function courseOf(grown, begun) {
  const own = { now: null, inputs: null, slice: null, have: 0, ended: true };

  /** Count the frames from the start that are there without a gap. */
  function counted() {
    while (own.now && own.now.frames[own.have]) own.have += 1;
    grown(own);
  }

  async function behind() {
    const inputs = await trying(numbers("/training/inputs"));
    const slice = own.now.plane ? await trying(numbers("/training/picture", { of: "training" })) : null;
    own.inputs = inputs || null;
    own.slice = slice ? sliceOf(slice) : null;
    counted();
  }

  function begin(told) {
    Object.assign(own, { now: told, inputs: null, slice: null, have: 0, ended: told.state !== "running" });
    begun();
    behind();
  }

  return Object.assign(own, {
    begin,
    /** Take an epoch; one that comes before the training it is of is fetched later. */
    add(frame) {
      if (!own.now || own.ended) return;
      own.now.frames[frame.n] = frame;
      counted();
    },
    /** Fetch what is missing, and how it ended. */
    async finish() {
      const { training } = (await trying(get("/api/training", { first: own.have }))) || {};
      if (!training || !own.now) return;
      const { frames } = own.now;
      for (const frame of training.frames) frames[frame.n] = frame;
      Object.assign(own.now, { ...training, frames });
      own.ended = training.state !== "running";
      counted();
    },
    /** Fetch the last training, where there was one. */
    async restore() {
      const { training } = (await trying(get("/api/training"))) || {};
      if (training && !own.now) begin(training);
    },
  });
}
