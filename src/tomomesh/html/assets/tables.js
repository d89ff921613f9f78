/**
 * Search in tables, and copy buttons: for pages of tomomesh, without a global.
 *
 * An input of class "search" filters the rows of all tables of class "searched"; sections without any are hidden.
 * A button of class "copy" copies the text of the element that its data-copies names.
 */
(() => {
  "use strict";
  document.documentElement.classList.add("scripted");

  function filter(words) {
    const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const table of document.querySelectorAll("table.searched")) {
      const section = table.dataset.section || "";
      let seen = 0;
      for (const row of table.tBodies[0].rows) {
        const text = `${section} ${row.textContent}`.toLowerCase();
        row.hidden = !wanted.every((word) => text.includes(word));
        seen += row.hidden ? 0 : 1;
      }
      (table.closest(".table-section") || table).hidden = seen === 0;
      found += seen;
    }
    return found;
  }

  for (const search of document.querySelectorAll("input.search")) {
    const told = document.getElementById(search.getAttribute("aria-describedby"));
    search.addEventListener("input", () => {
      const found = filter(search.value);
      told.textContent = search.value ? `${found} row${found === 1 ? "" : "s"} found` : "";
    });
  }

  async function copy(text) {
    if (navigator.clipboard && window.isSecureContext) return navigator.clipboard.writeText(text);
    const box = document.createElement("textarea");
    box.value = text;
    document.body.append(box);
    box.select();
    const done = document.execCommand("copy"); // files on a disk have no other way in some browsers
    box.remove();
    return done ? undefined : Promise.reject(new Error("not copied"));
  }

  for (const button of document.querySelectorAll("button.copy")) {
    const words = button.textContent;
    button.addEventListener("click", async () => {
      try {
        await copy(document.getElementById(button.dataset.copies).textContent);
        button.textContent = "Copied";
      } catch {
        button.textContent = "Not copied: select it";
      }
      setTimeout(() => { button.textContent = words; }, 2000);
    });
  }
})();
