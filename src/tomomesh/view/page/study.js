/** Study: not there yet. */
export const title = "Study";
export const keys = [];
export const applies = (kind) => kind === "study";

/** @param {HTMLElement} panel */
export function mount(panel) {
  panel.textContent = "";
  return { show() {}, hide() {}, key: () => false };
}
