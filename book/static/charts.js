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
  function colour(view) {
    const style = getComputedStyle(document.documentElement);
    const now = (name) => style.getPropertyValue(`--pst-color-${name}`).trim();
    return view.signal("ink", now("text-base")).signal("faint", now("border")).signal("paper", "transparent");
  }
  const paint = (view) => colour(view).runAsync();

  // paper is light
  let theme;
  addEventListener("beforeprint", () => {
    ({ theme } = document.documentElement.dataset);
    document.documentElement.dataset.theme = "light";
    views.forEach((view) => colour(view).run());
  });
  addEventListener("afterprint", () => {
    if (theme) document.documentElement.dataset.theme = theme;
    else delete document.documentElement.dataset.theme;
  });

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

  /** Call `seek` with the events of a pointer dragged in a panel, but not of a finger that scrolls the page. */
  function drag(panel, seek) {
    let from = null; // where a finger came down, until it moves sideways
    const moved = (event) => [Math.abs(event.clientX - from.clientX), Math.abs(event.clientY - from.clientY)];
    panel.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      from = event.pointerType === "touch" ? event : null;
      if (from) return;
      panel.setPointerCapture(event.pointerId);
      seek(event);
    });
    panel.addEventListener("pointermove", (event) => {
      if (!(event.buttons & 1)) return;
      if (from) {
        const [across, along] = moved(event);
        if (across < 8 || across < along) return;
        from = null;
      }
      seek(event);
    });
    panel.addEventListener("pointerup", (event) => {
      if (from && Math.max(...moved(event)) < 8) seek(event); // a tap
      from = null;
    });
    panel.addEventListener("pointercancel", () => (from = null));
  }

  window.bookCharts = { embed, drag };

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
