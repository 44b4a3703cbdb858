// What is wider than its box scrolls inside it: there the keyboard must reach it, and only there it stops.
"use strict";

(() => {
  const boxes = ".bd-article :is(div.math, .output, .cell_output, figure, .explorer-summary)";

  function mark() {
    for (const box of document.querySelectorAll(boxes)) {
      const scrolls = box.scrollWidth > box.clientWidth && ["auto", "scroll"].includes(getComputedStyle(box).overflowX);
      if (scrolls === (box.dataset.scrolls !== undefined)) continue;
      box.toggleAttribute("data-scrolls", scrolls);
      for (const [name, value] of [["tabindex", "0"], ["role", "group"], ["aria-label", "scrolls sideways"]]) {
        if (scrolls) box.setAttribute(name, value);
        else box.removeAttribute(name);
      }
    }
  }

  document.addEventListener("DOMContentLoaded", () => {
    // The page's size changes with its window's, and when a picture, a folded cell or the explorer comes in.
    const article = document.querySelector(".bd-article"); // the page of search results has none
    if (article) new ResizeObserver(mark).observe(article);
  });
})();
