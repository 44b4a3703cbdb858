// How long to train: a stopping point that the reader moves along all trainings (companion.studies.decisive.stopping_point
// has the numbers and says what they are, stopping_charts the charts).
"use strict";

(() => {
  /** An element with attributes and children. */
  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
    made.append(...children);
    return made;
  }

  const HEADINGS = {
    losses: "Along the training",
    figure3: "Figure 3, had all stopped there",
    saving: "What an SIDM with 5 minutes saves",
    search: "The search for settings",
  };
  const RULES = {
    "first rise": "Stopped at the first rise of the test loss",
    patience: "Stopped by patience",
    released: "Stopped by the released rule",
    end: "At the end of training",
  };
  const FLOOR = 0.01; // where the band of a saving without a lower bound ends, below the axis
  const CEILING = 1000;

  /** A number with two digits. */
  function digits(value) {
    if (value < 1) return value.toFixed(2);
    return value < 9.95 ? value.toFixed(1) : String(Number(value.toPrecision(2)));
  }

  const million = (samples) =>
    samples < 1e6 ? samples.toLocaleString("en") : `${(samples / 1e6).toLocaleString("en", { maximumFractionDigits: 1 })} million`;

  /** A ratio with its interval in words; null where a seed's curve gives only a bound. */
  const times = ([value, low, high]) =>
    value === null ? null : `${digits(value)} times (${digits(low)} to ${digits(high)})`;

  function build(root) {
    const data = JSON.parse(root.querySelector(".stopping-numbers").textContent);
    const specs = JSON.parse(root.querySelector(".stopping-charts").textContent);
    if (!data.recipes.length) return; // the picture stays
    const label = (training) => data.methods[training.method].label;

    /** Losses that were packed as text. */
    function unpack(text) {
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      const view = new DataView(bytes.buffer);
      return Array.from({ length: bytes.length / 2 }, (_, at) => view.getUint16(2 * at, true) / data.scale);
    }
    for (const training of [...data.recipes.flatMap((recipe) => recipe.trainings), ...data.search]) {
      training.kept = unpack(training.kept);
      const losses = unpack(training.curve);
      training.points = data.drawn[training.tests].map((test, at) => [(test + 1) * training.spacing, losses[at]]);
    }

    const state = { recipe: 0, minutes: data.minutes, stop: data.lengths.length - 1, rule: data.opens, draw: null };
    const recipe = () => data.recipes[state.recipe];

    // what the trainings keep

    /** [loss, samples at which it was reached] of a training of the recipe, by its place in the list. */
    function kept(training, place) {
      if (state.rule) return recipe().rules[state.rule].kept[place];
      return [training.kept[state.stop], training.at[state.stop] * training.spacing];
    }

    function figure3() {
      const sizes = new Map();
      recipe().trainings.forEach((training, place) => {
        const key = `${label(training)} ${training.minutes}`;
        if (!sizes.has(key)) sizes.set(key, { m: label(training), x: training.minutes, all: [] });
        sizes.get(key).all.push(kept(training, place)[0]);
      });
      return [...sizes.values()]
        .map(({ m, x, all }) => ({ m, x, y: Math.min(...all), high: Math.max(...all), mean: all.reduce((a, b) => a + b) / all.length }))
        .sort((a, b) => a.x - b.x);
    }

    const saving = (quantity) => {
      const source = state.rule ? recipe().rules[state.rule].saving : recipe().saving;
      return source[quantity]?.[state.rule ? 0 : state.stop] ?? [null, null, null];
    };
    const length = () => (state.rule ? recipe().rules[state.rule].samples : data.lengths[state.stop]);

    function words() {
      const stopped = state.rule
        ? RULES[state.rule]
        : `Stopped after ${million(data.lengths[state.stop])} samples`;
      const needed = times(saving(`data ${data.minutes}`));
      const ratio = times(saving(`loss ${state.minutes}`));
      const bound = state.rule && recipe().rules[state.rule].bound;
      const unknown = bound
        ? `${stopped}, the data ratio of an SIDM with ${data.minutes} minutes is ${bound}.`
        : `${stopped}, some seeds give no data ratio.`;
      const first = needed
        ? `${stopped}, training without an SIDM needs ${needed} the data of an SIDM with ${data.minutes} minutes.`
        : unknown;
      return ratio && specs.losses ? `${first} With ${state.minutes} min, the loss with an SIDM is ${ratio} that without one.` : first;
    }

    // rows of the charts

    const rows = {
      losses() {
        const shown = recipe().trainings.map((training, place) => [training, place]).filter(([training]) => training.minutes === state.minutes);
        const drawn = state.draw === null ? [] : data.search[state.draw].points.map(([x, y]) => ({ x, y }));
        return {
          curves: shown.flatMap(([training, place]) => training.points.map(([x, y]) => ({ m: label(training), s: place, x, y }))),
          kept: shown.map(([training, place]) => {
            const [y, x] = kept(training, place);
            return { m: label(training), x, y };
          }),
          draw: drawn,
          stop: state.rule ? [] : [{ x: length() }],
        };
      },
      figure3: () => ({ sizes: figure3() }),
      saving() {
        const bounded = ([y, low, high], x) => ({ x, y, low: low || FLOOR, high: high ?? CEILING });
        const known = ([y, low, high], x) => (y === null ? { x, y, low: y, high: y } : { x, y, low, high }); // a gap, or a ratio
        const here = saving(`data ${data.minutes}`);
        return {
          saving: (recipe().saving[`data ${data.minutes}`] ?? []).map((ratio, at) => known(ratio, data.lengths[at])),
          rules: Object.entries(recipe().rules).map(([rule, at]) => ({ rule, x: at.samples, y: at.saving[`data ${data.minutes}`]?.[0][0] })),
          here: here.some((end) => end !== null) ? [bounded(here, length())] : [],
          stop: [{ x: length() }],
        };
      },
      search() {
        const draws = data.search.map((draw, at) => ({ m: label(draw), x: draw.decay, y: searched(draw), words: settings(draw), at }));
        return { draws, picked: draws.filter((draw) => draw.at === state.draw) };
      },
    };
    // by a rule, the draws stand where the end leaves them
    const searched = (draw) => draw.kept[state.rule ? draw.kept.length - 1 : state.stop];
    const settings = (draw) =>
      `${label(draw)}, ${draw.number}: rate ${draw.rate.toPrecision(2)}, decay ${draw.decay.toPrecision(2)}, batch ${draw.batch}`;

    // controls

    const form = element("form", { class: "stopping-controls", "aria-label": "when trainings stop" });
    form.addEventListener("submit", (event) => event.preventDefault());
    const recipes = element("select", { id: "stopping-recipe" });
    data.recipes.forEach(({ name }, at) => recipes.append(element("option", { value: at }, name)));
    const minutes = element("select", { id: "stopping-minutes" });
    [...new Set(recipe().trainings.filter(({ method }) => method === "sidm").map((training) => training.minutes))]
      .sort((a, b) => a - b)
      .forEach((size) => minutes.append(element("option", { value: size }, `${size} min`)));
    const slider = element("input", { id: "stopping-stop", type: "range", min: 0, max: data.lengths.length - 1, step: 1 });
    const value = element("output", { for: slider.id });
    const buttons = data.rules.map((rule) => element("button", { type: "button" }, rule));
    const draws = element("select", { id: "stopping-draw" }, element("option", { value: "" }, "none"));
    data.search
      .map((draw, at) => [settings(draw), at])
      .sort(([a], [b]) => a.localeCompare(b, "en", { numeric: true }))
      .forEach(([text, at]) => draws.append(element("option", { value: at }, text)));
    const choice = (text, control, ...more) => element("div", {}, element("label", { for: control.id }, text), control, ...more);
    form.append(
      choice("recipe and robots", recipes),
      ...(specs.losses ? [choice("novice data", minutes)] : []),
      choice("stop after", slider, value),
      element("div", { role: "group", "aria-label": "stopping rules" }, element("span", {}, "or stopped by"), ...buttons),
    );
    const said = element("p", { class: "stopping-words", "aria-live": "polite" });
    const panels = Object.fromEntries(
      Object.keys(specs).map((name) => [name, element("div", { class: `stopping-chart stopping-${name}` })]),
    );
    const grid = element("div", { class: "stopping-grid" });
    const drawn = choice("as a dark line above", draws);
    for (const [name, panel] of Object.entries(panels)) grid.append(element("div", {}, element("p", {}, HEADINGS[name]), panel));
    if (panels.search) grid.lastChild.append(drawn);
    const legend = element("p", { class: "stopping-legend" });

    /** Name the methods that are drawn. */
    function nameMethods() {
      const used = new Set([...recipe().trainings, ...data.search].map(({ method }) => method));
      legend.replaceChildren(...Object.entries(data.methods)
        .filter(([name]) => used.has(name))
        .map(([, method]) => element("span", { style: `--colour: ${method.color}` }, method.label)));
    }

    function set(changes) {
      Object.assign(state, changes);
      show();
    }
    recipes.addEventListener("change", () => set({ recipe: Number(recipes.value) }));
    minutes.addEventListener("change", () => set({ minutes: Number(minutes.value) }));
    slider.addEventListener("input", () => set({ stop: slider.valueAsNumber, rule: null }));
    buttons.forEach((button, at) => button.addEventListener("click", () => set({ rule: data.rules[at] })));
    draws.addEventListener("change", () => set({ draw: draws.value === "" ? null : Number(draws.value) }));

    // the state in the address

    function remember() {
      const told = { recipe: recipe().id, minutes: state.minutes };
      if (state.rule) told.rule = state.rule;
      else told.stop = data.lengths[state.stop];
      if (state.draw !== null) told.draw = state.draw;
      const hash = `#${new URLSearchParams(told)}`;
      if (hash === location.hash) return;
      try {
        history.replaceState(null, "", hash);
      } catch {
        // a browser allows so many changes in a while; the next one tells the state again
      }
    }

    /** Take the state from the address, and say whether there is one. */
    function recall() {
      const told = new URLSearchParams(location.hash.slice(1));
      const at = data.recipes.findIndex(({ id }) => id === told.get("recipe"));
      if (at < 0) return false;
      state.recipe = at;
      if ([...minutes.options].some((option) => option.value === told.get("minutes"))) state.minutes = Number(told.get("minutes"));
      if (data.rules.includes(told.get("rule"))) state.rule = told.get("rule");
      else if (told.has("stop")) Object.assign(state, { rule: null, stop: nearest(Number(told.get("stop"))) });
      if (told.has("draw") && data.search[told.get("draw")]) state.draw = Number(told.get("draw"));
      return true;
    }

    /** The place of the length nearest to so many samples. */
    const nearest = (samples) => data.lengths.reduce(
      (best, one, at) => (Math.abs(Math.log(one / samples)) < Math.abs(Math.log(data.lengths[best] / samples)) ? at : best), 0);

    // drawing

    const views = {};
    let [drawing, waiting, begun] = [false, false, false];

    /** Show the state; while it changes faster than the charts, only where it got to. */
    async function show() {
      const last = recipe().trainings[0].kept.length - 1; // some recipes have no trainings as long as others
      if (!state.rule) state.stop = Math.min(state.stop, last);
      slider.max = last;
      nameMethods();
      recipes.value = state.recipe;
      minutes.value = state.minutes;
      draws.value = state.draw ?? "";
      slider.value = state.rule ? nearest(length()) : state.stop;
      value.textContent = state.rule ? "" : million(data.lengths[state.stop]);
      slider.setAttribute("aria-valuetext", `${million(data.lengths[slider.valueAsNumber])} samples`);
      buttons.forEach((button, at) => button.setAttribute("aria-pressed", state.rule === data.rules[at]));
      said.textContent = words();
      waiting = true;
      if (drawing) return;
      drawing = true;
      while (waiting) {
        waiting = false;
        await Promise.all(Object.entries(views).map(([name, view]) => {
          Object.entries(rows[name]()).forEach(([source, values]) => view.data(source, values));
          return view.runAsync();
        }));
      }
      drawing = false;
      if (begun) remember();
      root.dataset.shown = said.textContent;
    }

    /** Where the pointer is in a chart: the values of its axes. */
    function under(view, panel, event) {
      const box = panel.querySelector("canvas").getBoundingClientRect();
      const [left, top] = view.origin();
      const { left: padding, top: above } = view.padding();
      return [event.clientX - box.left - left - padding, event.clientY - box.top - top - above];
    }

    function drag(name) {
      window.bookCharts.drag(panels[name], (event) => {
        const [x] = under(views[name], panels[name], event);
        set({ stop: nearest(Math.max(views[name].scale("x").invert(x), 1)), rule: null });
      });
    }

    function pick(event) {
      const [x, y] = under(views.search, panels.search, event);
      const [across, up] = [views.search.scale("x"), views.search.scale("y")];
      const apart = data.search.map((draw) => Math.hypot(across(draw.decay) - x, up(searched(draw)) - y));
      const at = apart.indexOf(Math.min(...apart));
      const near = apart[at] < 20 ? at : state.draw;
      if (near !== state.draw) set({ draw: near });
    }

    async function start() {
      root.querySelector("img")?.remove();
      root.append(form, said, legend, grid);
      recall();
      for (const [name, panel] of Object.entries(panels)) views[name] = await window.bookCharts.embed(panel, specs[name]);
      ["losses", "saving"].filter((name) => panels[name]).forEach(drag);
      panels.search?.addEventListener("pointermove", pick);
      panels.search?.addEventListener("pointerdown", pick);
      await show();
      begun = true;
      new ResizeObserver(() => window.dispatchEvent(new Event("resize"))).observe(grid);
      addEventListener("hashchange", () => {
        if (recall()) show(); // else it is the address of a section
      });
    }

    return start();
  }

  document.addEventListener("DOMContentLoaded", () => document.querySelectorAll(".stopping").forEach(build));
})();
