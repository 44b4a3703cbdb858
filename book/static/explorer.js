// The suspension explorer: sliders choose among stored rides, Vega draws them (vega.js), the replay shows them driving.
// data.js has the charts and the sliders; rides and grounds come in pieces, as scripts, since pages from a disk may not fetch.
"use strict";

(() => {
  const data = window.explorerData;
  const { element, piece, unpack } = window.sidmReplay;
  const channels = Object.keys(data.channels);
  const script = document.currentScript.src;
  const size = data.moments * channels.length; // numbers a ride
  /** A stored ride up to where it leaves the ground: of each moment its channels, in m and rad. */
  function moments(numbers, index) {
    const found = [];
    for (let at = index * size; at < (index + 1) * size && numbers[at] !== data.gone; at += channels.length) {
      found.push(channels.map((name, i) => numbers[at + i] / data.channels[name]));
    }
    return found;
  }

  const attitude = (x, y, z) => [x, y, z, Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z))];
  const degrees = (angle) => (180 * angle) / Math.PI;

  /** Rows for the charts: {t, x, y, ...}, degrees, and mm of strut travel. */
  function rows(ride, who) {
    return ride.map(([x, y, z, i, j, k, ...rest], moment) => {
      const w = attitude(i, j, k)[3];
      const pitch = degrees(Math.asin(Math.min(Math.max(2 * (w * j - k * i), -1), 1)));
      const roll = degrees(Math.atan2(2 * (w * i + j * k), 1 - 2 * (i * i + j * j)));
      const struts = rest.slice(0, 4).map((travel, number) => [`strut ${number}`, 1e3 * travel]);
      return { t: moment * data.step, who, x, y, z, pitch, roll, ...Object.fromEntries(struts) };
    });
  }

  /** The angle of an axle's heave at the mean travel of its struts, the curve being that of skeleton.py. */
  function heave(curve, right, left) {
    if (!curve) return 0;
    const [a, b, c] = curve;
    const rest = c - (right + left) / 2;
    return (-2 * rest) / (b + Math.sqrt(b * b - 4 * a * rest));
  }

  /** The same ride for the replay. */
  function track(ride, name, number, body) {
    const joints = ride.map(([, , , , , , a, b, c, d, rear, front, ...rest]) => {
      const [kingpin] = rest.splice(4);
      return [heave(body.heave[0], a, b), rear, heave(body.heave[1], c, d), front, ...rest, kingpin, kingpin];
    });
    return {
      name, colour: data.colours[number], ghost: number ? 0.42 : 0, skeleton: body.skeleton,
      step: data.step, moments: ride.length, joint: 10, joints: Float32Array.from(joints.flat()),
      position: Float32Array.from(ride.flatMap((moment) => moment.slice(0, 3))),
      quaternion: Float32Array.from(ride.flatMap((moment) => attitude(...moment.slice(3, 6)))),
    };
  }

  /** Where the ride of these choices stands: `at` on each axis, as long as `sizes`. */
  const position = (at, sizes) => at.reduce((whole, one, axis) => whole * sizes[axis] + one, 0);

  const words = (knob, at) => `${knob.shown[at].toLocaleString("en")} ${knob.unit}`;

  function buildControls(form, changed) {
    const robot = element("select", { id: "explorer-robot" });
    data.robots.forEach((one, i) => robot.append(element("option", { value: i }, one.name)));
    const brakes = element("input", { id: "explorer-brakes", type: "checkbox", checked: "" });
    const weaves = element("input", { id: "explorer-weaves", type: "checkbox" });
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
        element("label", { for: brakes.id }, "joint motors hold the struts, as in the released simulator")),
      element("div", { class: "explorer-choice" }, weaves,
        element("label", { for: weaves.id }, "steer right and left, at half throttle")),
    );
    brakes.addEventListener("change", changed);
    const throttle = sliders[data.knobs.findIndex((knob) => knob.name === "throttle")];
    throttle.addEventListener("input", () => (weaves.checked = false), { capture: true });
    weaves.addEventListener("change", () => {
      throttle.value = data.weaving;
      changed();
    });
    robot.addEventListener("change", () => {
      data.knobs.slice(0, data.setUp).forEach((knob, i) => {
        sliders[i].value = data.robots[robot.value].knobs[knob.name];
      });
      changed();
    });
    return { robot, brakes, weaves, sliders };
  }

  /** The ground as rectangles for the chart of the path. */
  function rectangles(heights) {
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

  const HEAD = ["", "distance", "range of height", "range of pitch, roll", "most strut travel", "time at a stop"];

  /** Where a chart's axes begin in its picture. */
  const corner = (view) => [view.origin()[0] + view.padding().left, view.origin()[1] + view.padding().top];

  /** A line that stands in a chart at the replay's time; in the chart from above, a dot where each robot is. */
  function cursors(panels, views, replay) {
    let both = [];
    const marks = Object.entries(panels).map(([name, panel]) => {
      const shown = (name === "path" ? data.colours : [""]).map((colour) =>
        element("span", { class: name === "path" ? "explorer-dot" : "explorer-cursor", style: `--colour: ${colour}` }));
      panel.append(...shown);
      if (name !== "path") point(panel, views[name], replay);
      return [name, panel, shown];
    });
    let axes = []; // of each chart: where they begin, and their scales; measured when a chart changes, not in every frame

    function measure() {
      axes = marks.map(([name, panel, shown]) => {
        const [view, canvas] = [views[name], panel.querySelector("canvas")];
        const [left, top] = corner(view);
        if (name !== "path") shown[0].style.height = `${view.height()}px`;
        return { left: canvas.offsetLeft + left, top: canvas.offsetTop + top, wide: view.width(), x: view.scale("x"), y: view.scale("y") };
      });
    }

    function move(time) {
      marks.forEach(([name, , shown], number) => {
        if (!axes[number]) return;
        const { left, top, wide, x, y } = axes[number];
        shown.forEach((mark, i) => {
          const row = both[i]?.[Math.min(Math.round(time / data.step), both[i].length - 1)];
          const across = x(name === "path" ? (row?.x ?? NaN) : time);
          mark.hidden = !(across >= 0 && across <= wide);
          if (!mark.hidden) mark.style.transform = `translate(${left + across}px, ${top + (name === "path" ? y(row.y) : 0)}px)`;
        });
      });
    }

    replay.onTime(move);
    return (now = both) => {
      both = now;
      measure();
      move(replay.time);
    };
  }

  /** Pointing into a chart takes the replay to that time. */
  function point(panel, view, replay) {
    const seek = (event) => {
      if (!event.buttons) return;
      replay.play(false);
      const canvas = panel.querySelector("canvas").getBoundingClientRect();
      replay.seek(view.scale("x").invert(event.clientX - canvas.left - corner(view)[0]));
    };
    panel.addEventListener("pointerdown", seek);
    panel.addEventListener("pointermove", seek);
  }

  async function start() {
    const root = document.getElementById("explorer");
    const form = element("form", { class: "explorer-controls", "aria-label": "suspension and drive" });
    const table = element("table", { class: "table", "aria-live": "polite" });
    const charts = element("div", { class: "explorer-charts" });
    root.replaceChildren(form, element("div", { class: "explorer-summary" }, table), charts);
    form.addEventListener("submit", (event) => event.preventDefault());
    const replay = window.sidmReplay(document.getElementById("replay"), {
      label: "Replay: two robots drive over rough ground, your robot solid and the paper's robot as a ghost",
      film: new URL("robots.webp", script),
    });

    const grounds = data.grounds.map(rectangles);
    const [views, panels] = [{}, {}];
    const controls = buildControls(form, () => update());
    const drives = data.knobs[data.setUp + 1].shown.length + 1; // the last weaves
    for (const [name, spec] of Object.entries(data.charts)) {
      panels[name] = element("div", { class: "explorer-chart", role: "img", "aria-label": spec.description });
      charts.append(panels[name]); // all of them, before any measures its width
    }
    for (const [name, spec] of Object.entries(data.charts)) {
      const place = panels[name].appendChild(element("div"));
      views[name] = (await vegaEmbed(place, spec, { actions: false, renderer: "canvas", logLevel: 1 /* errors */ })).view;
      views[name].cleanThreshold = 500; // rows that it has done with and still holds; it would be 10,000
    }
    const move = cursors(panels, views, replay);

    // Vega measures its panels when the window changes; the page's side columns may change them later.
    new ResizeObserver(() => {
      window.dispatchEvent(new Event("resize"));
      requestAnimationFrame(() => requestAnimationFrame(() => move())); // when Vega has drawn
    }).observe(charts);

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
      const [rough, throttle] = at.slice(data.setUp);
      const brakes = controls.brakes.checked ? 0 : 1;
      const weaves = controls.weaves.checked ? 1 : 0;
      const robot = Number(controls.robot.value);
      const own = position(at.slice(0, data.setUp), sizes.slice(0, data.setUp));
      const setUps = sizes.slice(0, data.setUp).reduce((whole, one) => whole * one);
      const take = (text) => unpack(text, data.moments, channels.length);
      const [ownRides, otherRides, ground] = await Promise.all([
        piece(`rides-${2 * own + brakes}`, take),
        piece(`rides-${2 * (setUps + robot) + brakes}`, take),
        piece(`ground-${rough}`, window.sidmReplay.ground),
      ]);
      const ride = drives * rough + (weaves ? drives - 1 : throttle);
      const both = [ownRides, otherRides].map((numbers) => moments(numbers, ride));
      const lowest = data.knobs.findIndex((knob) => knob.name === "travel_lower");
      const names = [data.who[0], data.robots[robot].name];
      if (roughness !== rough) replay.setGround(ground);
      const bodies = [data.bodies[at[lowest]], data.robotBodies[robot]];
      replay.setTracks(both.map((one, i) => track(one, names[i], i, bodies[i][brakes])));
      const charted = both.map((one, i) => rows(one, data.who[i]));
      const stops = [[-data.knobs[lowest].shown[at[lowest]], data.ownUpperStop], data.robots[robot].stops];
      await chart(charted, stops, rough);
      roughness = rough;
      move(charted);
      table.replaceChildren(
        element("thead", {}, element("tr", {}, ...HEAD.map((word) => element("th", { scope: "col" }, word)))),
        element("tbody", {}, ...charted.map((one, i) => element("tr", { class: `explorer-line-${i}` },
          element("th", { scope: "row" }, names[i]),
          ...summary(one, stops[i]).map((word) => element("td", {}, word))))),
      );
      root.dataset.shown = [...at, brakes, weaves, robot].join("-"); // what the pictures show now
    }

    function chart(both, stops, rough) {
      const flat = both.flat();
      const stopRows = stops.flatMap((pair, i) => pair.map((v) => ({ v, who: data.who[i] })));
      return Promise.all(Object.entries(views).map(([name, view]) => {
        if (name === "path") {
          if (roughness !== rough) view.data("ground", grounds[rough]);
          view.data("ride", flat);
        } else {
          const of = name === "height" ? "z" : name;
          view.data("ride", flat.map((row) => ({ t: row.t, who: row.who, v: row[of] })));
          if (name.startsWith("strut")) view.data("stops", stopRows);
        }
        return view.runAsync();
      }));
    }

    await update();
    replay.start();
  }

  start();
})();
