/** Surface: not there yet. */
export const title = "Surface";
export const keys = [];
export const applies = (kind) => kind === "study";

/** @param {HTMLElement} panel */
export function mount(panel) {
  panel.textContent = "";
  return { show() {}, hide() {}, key: () => false };
}
