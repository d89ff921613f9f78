/** Saving: not there yet. */
export const title = "Saving";
export const keys = [];
export const applies = (kind) => kind === "study";

/** @param {HTMLElement} panel */
export function mount(panel) {
  panel.textContent = "";
  return { show() {}, hide() {}, key: () => false };
}
