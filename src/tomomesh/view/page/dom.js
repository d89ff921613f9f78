/** Elements, made in a line. */

/**
 * Make an element.
 * @param {string} tag
 * @param {Record<string, any>} [having] attributes; those that are functions are handlers, as onclick
 * @param {...(Node|string|number|null|undefined|false)} within
 * @returns {any}
 */
export function el(tag, having = {}, ...within) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(having)) {
    if (typeof value === "function") made[name.toLowerCase()] = value;
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, String(value));
  }
  made.append(...within.filter((one) => one !== null && one !== undefined && one !== false));
  return made;
}

/** Put an element's content in the place of what it has. @param {Element} element @param {...any} within */
export function fill(element, ...within) {
  element.replaceChildren(...within.filter((one) => one !== null && one !== undefined && one !== false));
}

/** Put a number into few letters. @param {number} value @param {number} [digits] */
export function short(value, digits = 4) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : "-";
}

/**
 * Call no sooner than a frame from now, and once for many calls.
 * @param {() => void} work
 */
export function eachFrame(work) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      work();
    });
  };
}
