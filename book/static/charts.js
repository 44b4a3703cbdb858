// Charts that Vega draws, in the page's colours; a chart's specification stands beside the picture that it takes the place of.
"use strict";

(() => {
  const vega = new URL("explorer/vega.js", document.currentScript.src).href;
  const views = [];
  let loading;

  /** Vega, loaded once. */
  function load() {
    if (window.vegaEmbed) return Promise.resolve();
    loading ??= new Promise((done, failed) => {
      const script = document.createElement("script");
      Object.assign(script, { src: vega, onload: done, onerror: failed });
      document.head.append(script);
    });
    return loading;
  }

  /** Give a chart the colours that the page has now. */
  function paint(view) {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--pst-color-${name}`).trim();
    view.signal("ink", colour("text-base")).signal("faint", colour("border")).signal("paper", "transparent");
    return view.runAsync();
  }

  /** Draw a specification of companion.figures.themed in a place; returns Vega's view. */
  async function embed(place, spec) {
    await load();
    const { view } = await vegaEmbed(place, spec, { actions: false, renderer: "canvas", logLevel: 1 /* errors */ });
    const canvas = place.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", spec.description);
    views.push(view);
    await paint(view);
    return view;
  }

  window.bookCharts = { embed };

  document.addEventListener("DOMContentLoaded", async () => {
    new MutationObserver(() => views.forEach(paint)).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    for (const chart of document.querySelectorAll(".vega-chart")) {
      const spec = JSON.parse(chart.querySelector("script").textContent);
      const place = document.createElement("div");
      place.className = "vega-chart-drawn";
      chart.append(place);
      await embed(place, spec);
      chart.querySelector("img")?.remove();
      chart.dataset.drawn = "";
    }
  });
})();
