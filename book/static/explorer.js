// The suspension explorer: sliders choose among stored rides (data.js), Vega draws them (vega.js).
"use strict";

(() => {
  const data = window.explorerData;
  const channels = Object.keys(data.channels);
  const size = data.moments * channels.length; // numbers a ride

  /** Whole numbers from base64 and deflate, their changes along time added up again. */
  async function unpack(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const numbers = new Int16Array(await new Response(stream).arrayBuffer());
    for (let i = 0; i < numbers.length; i++) {
      if (i % size >= channels.length) numbers[i] += numbers[i - channels.length]; // wraps as it did when taken
    }
    return numbers;
  }

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...children);
    return made;
  }

  /** Rows of a ride up to where it leaves the ground: {t, x, y, ...} in the units of the charts. */
  function rows(numbers, index, who) {
    const found = [];
    for (let moment = 0; moment < data.moments; moment++) {
      const at = index * size + moment * channels.length;
      if (numbers[at] === data.gone) break;
      const row = { t: moment * data.step, who };
      channels.forEach((name, i) => (row[name] = numbers[at + i] / data.channels[name]));
      found.push(row);
    }
    return found;
  }

  /** Where the ride of these choices stands: `at` on each axis, as long as `sizes`. */
  const position = (at, sizes) => at.reduce((whole, one, axis) => whole * sizes[axis] + one, 0);

  const words = (knob, at) => `${knob.shown[at].toLocaleString("en")} ${knob.unit}`;

  function buildControls(form, changed) {
    const robot = element("select", { id: "explorer-robot" });
    data.robots.forEach((one, i) => robot.append(element("option", { value: i }, one.name)));
    const brakes = element("input", { id: "explorer-brakes", type: "checkbox", checked: "" });
    robot.value = 1; // another than the sliders start at: two lines to compare
    form.append(
      element("div", { class: "explorer-choice" }, element("label", { for: robot.id }, "the paper's robot"), robot),
    );
    const sliders = data.knobs.map((knob) => {
      const id = `explorer-${knob.name}`;
      const range = { id, type: "range", min: 0, max: knob.shown.length - 1, step: 1, value: knob.start };
      const slider = element("input", range);
      const value = element("output", { for: id });
      slider.show = () => {
        value.textContent = words(knob, slider.valueAsNumber);
        slider.setAttribute("aria-valuetext", value.textContent);
      };
      slider.addEventListener("input", changed);
      form.append(element("div", {}, element("label", { for: id }, knob.label), slider, value));
      return slider;
    });
    form.append(
      element("div", { class: "explorer-choice" }, brakes,
        element("label", { for: brakes.id }, "struts braked, as in the recorded robots")),
    );
    brakes.addEventListener("change", changed);
    robot.addEventListener("change", () => {
      data.knobs.slice(0, data.setUp).forEach((knob, i) => {
        sliders[i].value = data.robots[robot.value].knobs[knob.name];
      });
      changed();
    });
    return { robot, brakes, sliders };
  }

  /** The pieces of ground as rectangles for the chart of the path. */
  function pieces(heights) {
    const [left, right, low, , cell] = data.view;
    const columns = Math.round((right - left) / cell);
    return heights.map((height, i) => {
      const x = left + (i % columns) * cell;
      const y = low + Math.floor(i / columns) * cell;
      return { x, x2: x + cell, y, y2: y + cell, h: height / 100 };
    });
  }

  /** How a ride went, in a table's cells. */
  function summary(ride, stops) {
    const range = (name) => {
      const values = ride.map((row) => row[name]);
      return Math.max(...values) - Math.min(...values);
    };
    const struts = channels.filter((name) => name.startsWith("strut"));
    const near = (value) => stops.some((stop) => Math.abs(value - stop) < 0.2); // mm
    const atStops = struts.map((name) => ride.filter((row) => near(row[name])).length / ride.length);
    const end = ride[ride.length - 1];
    return [
      `${Math.hypot(end.x, end.y).toFixed(1)} m`,
      `${(100 * range("z")).toFixed(0)} cm`,
      `${range("pitch").toFixed(0)}° and ${range("roll").toFixed(0)}°`,
      `${Math.max(...struts.map(range)).toFixed(1)} mm`,
      `${(100 * Math.max(...atStops)).toFixed(0)} %`,
    ];
  }

  const HEAD = ["", "distance", "range of height", "of pitch and roll", "most strut travel", "longest at a stop"];

  async function start() {
    const root = document.getElementById("explorer");
    const form = element("form", { class: "explorer-controls", "aria-label": "set-up and drive" });
    const table = element("table", { class: "table", "aria-live": "polite" });
    const panels = element("div", { class: "explorer-charts" });
    root.replaceChildren(form, element("div", { class: "explorer-summary" }, table), panels);
    form.addEventListener("submit", (event) => event.preventDefault());

    const [rides, robotRides] = await Promise.all([unpack(data.rides), unpack(data.robotRides)]);
    const grounds = data.grounds.map(pieces);
    const views = {};
    const controls = buildControls(form, () => update());
    const places = Object.entries(data.charts).map(([name, spec]) => {
      const panel = element("div", { class: "explorer-chart", role: "img", "aria-label": spec.description });
      panels.append(panel); // all of them, before any measures its width
      return [name, spec, panel];
    });
    for (const [name, spec, panel] of places) {
      views[name] = (await vegaEmbed(panel, spec, { actions: false, renderer: "canvas", logLevel: 1 /* errors */ })).view;
    }

    // Vega measures its panels when the window changes; the page's side columns may change them later.
    new ResizeObserver(() => window.dispatchEvent(new Event("resize"))).observe(panels);

    let [roughness, drawing, waiting] = [-1, false, false];

    /** Draw what the sliders say; while they move on faster than that, only where they got to. */
    async function update() {
      controls.sliders.forEach((slider) => slider.show());
      waiting = true;
      if (drawing) return;
      drawing = true;
      while (waiting) {
        waiting = false;
        await draw();
      }
      drawing = false;
    }

    async function draw() {
      const at = controls.sliders.map((slider) => slider.valueAsNumber);
      const sizes = data.knobs.map((knob) => knob.shown.length);
      const [setUp, drive] = [at.slice(0, data.setUp), at.slice(data.setUp)];
      const rest = [controls.brakes.checked ? 0 : 1, ...drive];
      const robot = Number(controls.robot.value);
      const [own, other] = data.who;
      const both = [
        rows(rides, position([...setUp, ...rest], [...sizes.slice(0, data.setUp), 2, ...sizes.slice(data.setUp)]), own),
        rows(robotRides, position([robot, ...rest], [data.robots.length, 2, ...sizes.slice(data.setUp)]), other),
      ];
      const lowest = data.knobs.findIndex((knob) => knob.name === "travel_lower");
      const stops = [[-data.knobs[lowest].shown[at[lowest]], data.ownUpperStop], data.robots[robot].stops];
      const flat = both.flat();
      const stopRows = stops.flatMap((pair, i) => pair.map((v) => ({ v, who: data.who[i] })));
      await Promise.all(Object.entries(views).map(([name, view]) => {
        if (name === "path") {
          if (roughness !== drive[0]) view.data("ground", grounds[drive[0]]);
          view.data("ride", flat);
        } else {
          const of = name === "height" ? "z" : name;
          view.data("ride", flat.map((row) => ({ t: row.t, who: row.who, v: row[of] })));
          if (name.startsWith("strut")) view.data("stops", stopRows);
        }
        return view.runAsync();
      }));
      roughness = drive[0];
      const names = [own, data.robots[robot].name];
      table.replaceChildren(
        element("thead", {}, element("tr", {}, ...HEAD.map((word) => element("th", { scope: "col" }, word)))),
        element("tbody", {}, ...both.map((ride, i) => element("tr", { class: `explorer-line-${i}` },
          element("th", { scope: "row" }, names[i]),
          ...summary(ride, stops[i]).map((word) => element("td", {}, word))))),
      );
      root.dataset.shown = [...at, rest[0], robot].join("-"); // what the pictures show now
    }
    await update();
  }

  start();
})();
