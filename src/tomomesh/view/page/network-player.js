/** Plays what was received of a training: no epoch is left out, however quick the training is. */

/** Epochs a second, and what they are called. */
export const SPEEDS = [[1, "1 a second"], [4, "4 a second"], [10, "10 a second"], [30, "30 a second"]];

/**
 * Make a player.
 * @param {(at: number) => void} show shows a frame
 */
export function player(show) {
  let at = -1;
  let received = 0;
  let ended = true;
  let playing = false;
  let each = 100;
  let last = 0;
  let asked = 0;

  function tick(now) {
    asked = 0;
    if (!playing) return;
    if (at + 1 < received && now - last >= each - 2) {
      last = now;
      to(at + 1);
    }
    if (ended && at + 1 >= received) pause();
    else next();
  }

  function next() {
    if (!asked) asked = requestAnimationFrame(tick);
  }

  function to(frame) {
    at = Math.max(0, Math.min(frame, received - 1));
    if (received) show(at);
  }

  function play() {
    if (ended && at + 1 >= received) at = -1;
    playing = true;
    next();
    show(Math.max(at, 0));
  }

  function pause() {
    playing = false;
    if (received) show(Math.max(at, 0));
  }

  return {
    /** Begin anew. */
    begin() {
      [at, received, ended, playing] = [-1, 0, false, true];
      next();
    },
    /** Be told how many frames there are, and whether more will come. */
    have(count, done) {
      [received, ended] = [count, done];
      if (playing) next();
      else if (at >= 0) show(at);
    },
    /** Step by some frames, and stand. */
    step(by) {
      playing = false;
      to(at + by);
    },
    /** Go to a frame, and stand. */
    seek(frame) {
      playing = false;
      to(frame);
    },
    /** Leave the stage to something else, until there is a reason to play again. */
    leave() {
      [at, playing] = [-1, false];
    },
    toggle: () => (playing ? pause() : play()),
    speed(perSecond) {
      each = 1000 / perSecond;
    },
    get at() {
      return at;
    },
    get playing() {
      return playing;
    },
  };
}
