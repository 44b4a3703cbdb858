// Charts of a page: a chart's specification stands beside the picture that it takes the place of.
"use strict";

(() => {
  const vega = new URL("explorer/vega.js", document.currentScript.src).href;

  function load(source) {
    return new Promise((done, failed) => {
      const script = document.createElement("script");
      Object.assign(script, { src: source, onload: done, onerror: failed });
      document.head.append(script);
    });
  }

  document.addEventListener("DOMContentLoaded", async () => {
    const charts = [...document.querySelectorAll(".vega-chart")];
    if (!charts.length) return;
    if (!window.vegaEmbed) await load(vega);
    for (const chart of charts) {
      const spec = JSON.parse(chart.querySelector("script").textContent);
      const panel = document.createElement("div");
      panel.className = "vega-chart-drawn";
      chart.append(panel);
      await vegaEmbed(panel, spec, { actions: false, renderer: "canvas", logLevel: 1 /* errors */ });
      const canvas = panel.querySelector("canvas");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", spec.description);
      chart.querySelector("img")?.remove();
      chart.dataset.drawn = "";
    }
  });
})();
