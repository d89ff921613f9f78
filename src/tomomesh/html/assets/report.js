/** The 3-D view of a report, its tools, and problems that one can fly to. */
(() => {
  "use strict";
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const element = document.getElementById("view");
  const data = document.getElementById("scene");
  if (!element || !data || !globalThis.tomomeshViewer) return;
  const viewer = globalThis.tomomeshViewer.createViewer(element, { dark: dark.matches });
  if (!viewer) return;

  const bytes = Uint8Array.from(atob(data.textContent.trim()), (letter) => letter.charCodeAt(0));
  const scene = globalThis.tomomeshViewer.decodeScene(bytes.buffer);
  viewer.show(scene);
  document.documentElement.classList.add("drawn");
  viewer.redraw();
  dark.addEventListener("change", () => viewer.setDark(dark.matches));

  const tool = (name) => document.getElementById(`tool-${name}`);
  tool("fit").addEventListener("click", () => viewer.fit());
  tool("wire").addEventListener("change", ({ target }) => viewer.setWire(target.checked));
  element.addEventListener("keyup", () => { tool("wire").checked = viewer.wire; });

  for (const told of scene.header.values) {
    const option = document.createElement("option");
    option.value = told.name;
    option.textContent = told.title;
    tool("color").append(option);
  }
  tool("color").closest("label").hidden = scene.header.values.length === 0;
  tool("color").addEventListener("change", ({ target }) => {
    const told = scene.header.values.find((one) => one.name === target.value);
    viewer.setColors(told ? scene.values[told.name] : null, told);
  });

  function cut() {
    const axis = ["x", "y", "z"].indexOf(tool("axis").value);
    tool("cut").disabled = axis < 0;
    const share = Number(tool("cut").value) / 1000;
    const normal = [0, 0, 0];
    if (axis >= 0) normal[axis] = -1;
    viewer.clip(axis < 0 ? null : { normal, offset: -(scene.center[axis] + (2 * share - 1) * scene.half[axis]) });
  }
  tool("axis").addEventListener("change", cut);
  tool("cut").addEventListener("input", cut);

  /* From one place to the next, and after the last to the first. */
  for (const button of document.querySelectorAll("button.fly")) {
    const places = button.dataset.places.split(";").map((one) => one.split(" ").map(Number));
    let at = 0;
    button.addEventListener("click", () => {
      const [x, y, z, radius] = places[at];
      at = (at + 1) % places.length;
      if (places.length > 1) button.textContent = `Show ${at + 1} of ${places.length}`;
      viewer.fly([x, y, z], radius);
      element.scrollIntoView({ block: "nearest" });
    });
  }
})();
