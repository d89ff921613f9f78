/** What is said of networks. */

export const EMPTY = "Choose a figure of the paper, or what to train on and how: every epoch of the training is shown here.";

/** Say which epoch is shown, of how many. */
export function ofFrame(course, { n, kind }) {
  const { steps, training, state } = course;
  if (kind === "start") return "Start";
  if (kind === "spaced") return "As the run hands it on";
  const stopped = state === "stopped" && n === course.count - 1 ? ", stopped" : "";
  if (n >= steps.length) return `Pass ${n - steps.length + 1} without strays${stopped}`;
  if (training === "online") return `Presentation ${steps[n].toLocaleString("en")} of ${steps[steps.length - 1].toLocaleString("en")}${stopped}`;
  return `Epoch ${n} of ${epochs(course)}${stopped}`;
}

/** Count the epochs: those that are planned, or fewer where there were. */
function epochs({ frames, steps, state }) {
  const planned = steps.length - 1;
  return state === "running" ? planned : Math.min(planned, frames.filter((one) => one.kind === "epoch").length);
}

/** Say what the networks of a slice are. */
export function ofSlice(networks, k) {
  if (!networks) return "";
  const count = networks.networks.length;
  const stale = networks.fresh ? "" : " The choices have changed since: train all slices again.";
  if (!count) return `Slice ${k} has no network: too little of the window is on it, or the run trains none there.${stale}`;
  return `${count === 1 ? "The network" : `The ${count} networks`} of slice ${k}, as a run hands ${count === 1 ? "it" : "them"} on.${stale}`;
}
