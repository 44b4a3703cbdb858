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
    let before = 0; // the roll goes on where a robot turns over
    return ride.map(([x, y, z, i, j, k, ...rest], moment) => {
      const w = attitude(i, j, k)[3];
      const pitch = degrees(Math.asin(Math.min(Math.max(2 * (w * j - k * i), -1), 1)));
      let roll = degrees(Math.atan2(2 * (w * i + j * k), 1 - 2 * (i * i + j * j)));
      roll += 360 * Math.round((before - roll) / 360);
      before = roll;
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

  const setUp = data.knobs.slice(0, data.setUp);
  const sizes = data.knobs.map((knob) => knob.shown.length);
  const setUps = sizes.slice(0, data.setUp).reduce((whole, one) => whole * one);
  const spring = setUp.findIndex((knob) => knob.name === "spring");
  const stopAxes = [data.setUp - 2, data.setUp];

  /** One of the paper's robots. */
  const paperRobot = (number) => {
    const { name, ...values } = data.robots[number];
    return { name, values, rides: setUps + number, bodies: data.robotBodies[number] };
  };

  /** The robot of these sliders. */
  function ownRobot(at) {
    const values = { ...data.body, ...Object.fromEntries(setUp.map((knob, i) => [knob.name, knob.values[at[i]]])) };
    const same = data.robots.find((robot) => Object.keys(values).every((field) => robot[field] === values[field]));
    const body = position(at.slice(...stopAxes), sizes.slice(...stopAxes));
    return { name: same?.name ?? "your robot", values, rides: position(at, sizes), bodies: data.bodies[body] };
  }

  /** The twin of the robot of these sliders that has another spring. */
  const twin = (number, at) => ({ ...ownRobot(at.map((place, axis) => (axis === spring ? number : place))), name: data.twins[number] });

  /** The sliders at a robot's values. */
  const placesOf = (values) => setUp.map((knob) => knob.values.indexOf(values[knob.name]));

  /** What the buttons choose: the first robot (null: that of the sliders), its sliders, and the second robot. */
  const presets = {
    ...Object.fromEntries(Object.entries(data.pairs).map(([words, [first, second]]) =>
      [words, () => ({ first, second, at: placesOf(data.robots[first]) })])),
    "only the springs": ([first, second]) => ({
      first: null, second: data.robots.length + placesOf(data.robots[second])[spring], at: placesOf(data.robots[first]),
    }),
  };

  function buildControls(form, changed) {
    let first = null; // the paper's robot that drives first, unless the sliders' does
    let [pair] = Object.values(data.pairs); // that a button chose last
    const second = element("select", { id: "explorer-robot" },
      ...[["the paper's robots", data.robots.map(({ name }) => name)], ["the same robot with another spring", data.twins]]
        .map(([label, names], group) => element("optgroup", { label },
          ...names.map((name, i) => element("option", { value: group * data.robots.length + i }, name)))));
    const brakes = element("input", { id: "explorer-brakes", type: "checkbox", checked: "" });
    const weaves = element("input", { id: "explorer-weaves", type: "checkbox" });
    const choice = (...parts) => element("div", { class: "explorer-choice" }, ...parts);
    const sliders = data.knobs.map((knob, number) => {
      const id = `explorer-${knob.name}`;
      const range = { id, type: "range", min: 0, max: knob.shown.length - 1, step: 1, value: knob.start };
      const slider = element("input", range);
      const value = element("output", { for: id });
      slider.show = () => {
        value.textContent = words(knob, slider.valueAsNumber);
        slider.setAttribute("aria-valuetext", value.textContent);
      };
      slider.addEventListener("input", () => {
        if (number < data.setUp) first = null;
        changed();
      });
      slider.row = element("div", {}, element("label", { for: id }, knob.label), slider, value);
      return slider;
    });
    const at = () => sliders.map((slider) => slider.valueAsNumber);

    /** Move the suspension's sliders, and choose robots. */
    function set(to) {
      first = to.first;
      to.at.forEach((place, i) => (sliders[i].value = place));
      second.value = to.second;
      changed();
    }
    const buttons = Object.entries(presets).map(([label, preset]) => {
      const button = element("button", { type: "button" }, label);
      button.addEventListener("click", () => {
        pair = data.pairs[label] ?? pair;
        set(preset(pair));
      });
      button.show = () => {
        const here = { first, second: Number(second.value), at: at().slice(0, data.setUp) };
        button.setAttribute("aria-pressed", JSON.stringify(preset(pair)) === JSON.stringify(here));
      };
      return button;
    });
    const take = element("button", { type: "button" }, "take its springs, dampers and travel");
    take.addEventListener("click", () => set({ first: null, second: second.value, at: placesOf(robots()[1].values) }));

    /** Both robots. */
    function robots() {
      const [own, other] = [at().slice(0, data.setUp), Number(second.value)];
      return [
        first === null ? ownRobot(own) : paperRobot(first),
        other < data.robots.length ? paperRobot(other) : twin(other - data.robots.length, own),
      ];
    }

    form.append(
      element("div", { class: "explorer-choice", role: "group", "aria-label": "robots to compare" }, ...buttons),
      ...sliders.slice(0, data.setUp).map(({ row }) => row),
      choice(element("label", { for: second.id }, "beside it, as a ghost"), second, take),
      ...sliders.slice(data.setUp).map(({ row }) => row),
      choice(brakes, element("label", { for: brakes.id }, "joint motors hold the struts, as in the released simulator")),
      choice(weaves, element("label", { for: weaves.id }, "steer right and left, at half throttle")),
    );
    brakes.addEventListener("change", changed);
    const throttle = sliders[data.knobs.findIndex((knob) => knob.name === "throttle")];
    throttle.addEventListener("input", () => (weaves.checked = false), { capture: true });
    weaves.addEventListener("change", () => {
      throttle.value = data.weaving;
      changed();
    });
    second.addEventListener("change", () => {
      if (second.value >= data.robots.length) first = null; // a twin is that of the sliders' robot
      changed();
    });
    second.value = presets["only the springs"](pair).second;
    const show = () => [...sliders, ...buttons].forEach((control) => control.show());
    const state = () => [...at(), brakes.checked ? 0 : 1, weaves.checked ? 1 : 0, first ?? "own", second.value];
    return { at, brakes, weaves, robots, show, state };
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

  const number = (value) => value.toLocaleString("en", { maximumFractionDigits: 3 }).replace("-", "−");

  /** A robot's value, or both ends of its range, in the row's unit; as comparison.py does. */
  const ends = (row, values) => row.fields.map((field) => row.scale * values[field]);
  const span = ([low, high]) => (high === undefined ? low : high - low);

  function valueText(row, values) {
    const both = ends(row, values);
    const range = both.length > 1 ? ` (${both.map(number).join(" to ")})` : "";
    return `${number(span(both))} ${row.unit}`.trim() + range;
  }

  function times(name, first, second) {
    if (Math.abs(first - second) < 1e-9) return `the same ${name}`;
    const ratio = Math.max(first, second) / Math.min(first, second);
    const words = ratio.toFixed(ratio > 9.95 ? 0 : 1).replace(/\.0$/, "");
    return `${words} times ${first > second ? "the" : "less"} ${name}`;
  }

  /** How two robots differ, and how far apart their rides end. */
  function inWords(robots, rides) {
    const values = robots.map((robot) => robot.values);
    const ratios = data.rows.slice(0, 3).map((row) => times(row.label, ...values.map((one) => span(ends(row, one)))));
    const gears = data.rows.slice(3, 5).map((row) => values.map((one) => valueText(row, one)));
    const [wheels, angle] = gears.map((pair) => pair.join(" against "));
    const gearing = gears.every(([one, other]) => one === other)
      ? "The gearing is the same."
      : `What differs most is the gearing: full throttle asks for wheels at ${wheels}, full steering for an angle of ${angle}.`;
    const last = Math.min(...rides.map((ride) => ride.length)) - 1; // one may leave the ground earlier
    const [one, other] = rides.map((ride) => ride[last]);
    const apart = Math.hypot(one.x - other.x, one.y - other.y, one.z - other.z).toFixed(2);
    const beside = `${robots[0].name} beside ${robots[1].name}`;
    return `${beside[0].toUpperCase()}${beside.slice(1)}: ${ratios.join(", ")}. ${gearing} `
      + `After ${number(last * data.step)} s they are ${apart} m apart.`;
  }

  const stopsOf = ({ travel_lower: lower, travel_upper: upper }) => [1e3 * lower, 1e3 * upper]; // mm

  /** Shares of the time that struts are at a stop; motors hold the rear ones where they do not meet their upper stop. */
  function atStops(ride, values, held) {
    const [lower, upper] = stopsOf(values);
    const near = (travel, stop) => Math.abs(travel - stop) < 1e3 * data.near;
    const shares = data.struts.map((name, i) => {
      const stops = held && data.held.includes(i) ? [lower] : [lower, upper];
      const there = ride.filter((row) => stops.some((stop) => near(row[`strut ${i}`], stop)));
      return [name, Math.round((100 * there.length) / ride.length)];
    });
    return shares.filter(([, share]) => share).map(([name, share]) => `${name} ${share}\u00a0%`).join(", ") || "none";
  }

  /** The measures of a ride in words. */
  function summary(ride, values, held) {
    const range = (name) => {
      const values = ride.map((row) => row[name]);
      return Math.max(...values) - Math.min(...values);
    };
    const end = ride[ride.length - 1];
    return [
      `${Math.hypot(end.x, end.y).toFixed(1)} m`,
      `${(100 * range("z")).toFixed(0)} cm`,
      `${range("pitch").toFixed(0)}° and ${range("roll").toFixed(0)}°`,
      `${Math.max(...data.struts.map((_, i) => range(`strut ${i}`))).toFixed(1)} mm`,
      atStops(ride, values, held),
    ];
  }

  /** The robots' values in one table, the measures of their rides in another. */
  function fill(tables, robots, rides, held) {
    const rows = data.rows.map((row) => [row.label, ...robots.map(({ values }) => valueText(row, values))]);
    const measures = robots.map(({ values }, i) => summary(rides[i], values, held));
    const measured = data.measures.map((label, i) => [label, ...measures.map((texts) => texts[i])]);
    [rows, measured].forEach((lines, number) => tables[number].replaceChildren(
      element("thead", {}, element("tr", {}, element("td"),
        ...robots.map(({ name }, i) => element("th", { scope: "col", class: `explorer-line-${i}` }, name)))),
      element("tbody", {}, ...lines.map(([label, ...texts]) => element("tr", {},
        element("th", { scope: "row" }, label), ...texts.map((text) => element("td", {}, text))))),
    ));
  }

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
        const [box, around] = [canvas, panel].map((part) => part.getBoundingClientRect());
        return {
          left: box.left - around.left + left, top: box.top - around.top + top,
          wide: view.width(), x: view.scale("x"), y: view.scale("y"),
        };
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
    window.bookCharts.drag(panel, (event) => {
      replay.play(false);
      const canvas = panel.querySelector("canvas").getBoundingClientRect();
      replay.seek(view.scale("x").invert(event.clientX - canvas.left - corner(view)[0]));
    });
  }

  async function start() {
    const root = document.getElementById("explorer");
    const form = element("form", { class: "explorer-controls", "aria-label": "suspension and drive" });
    const said = element("p", { class: "explorer-words", "aria-live": "polite" });
    const tables = [0, 1].map(() => element("table", { class: "table" }));
    const charts = element("div", { class: "explorer-charts" });
    root.replaceChildren(said, form, element("p", { class: "explorer-scrolls" }, "The table scrolls sideways."),
      element("div", { class: "explorer-summary" }, ...tables), charts);
    form.addEventListener("submit", (event) => event.preventDefault());
    const replay = window.sidmReplay(document.getElementById("replay"), {
      label: "Replay: two robots drive over rough ground, the first solid and the second as a ghost",
      film: new URL("robots.webp", script),
    });

    const grounds = data.grounds.map(rectangles);
    const [views, panels] = [{}, {}];
    const controls = buildControls(form, () => update());
    const drives = data.knobs[data.setUp + 1].shown.length + 1; // the last weaves
    for (const name of Object.keys(data.charts)) {
      panels[name] = element("div", { class: "explorer-chart" });
      charts.append(panels[name]); // all of them, before any measures its width
    }
    for (const [name, spec] of Object.entries(data.charts)) {
      const place = panels[name].appendChild(element("div"));
      views[name] = await window.bookCharts.embed(place, spec);
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
      controls.show();
      waiting = true;
      if (drawing) return;
      drawing = true;
      try {
        while (waiting) {
          waiting = false;
          await draw();
        }
      } catch {
        said.textContent = "These rides could not be loaded. Move a slider to try again.";
      } finally {
        drawing = false;
      }
    }

    async function draw() {
      const [at, robots, state] = [controls.at(), controls.robots(), controls.state().join("-")];
      const [rough, throttle] = at.slice(data.setUp);
      const held = controls.brakes.checked;
      const brakes = held ? 0 : 1;
      const ride = drives * rough + (controls.weaves.checked ? drives - 1 : throttle);
      const take = (text) => unpack(text, data.moments, channels.length);
      const [ground, ...numbers] = await Promise.all([
        piece(`ground-${rough}`, window.sidmReplay.ground),
        ...robots.map(({ rides }) => piece(`rides-${2 * rides + brakes}`, take)),
      ]);
      const both = numbers.map((rides) => moments(rides, ride));
      if (roughness !== rough) replay.setGround(ground);
      replay.setTracks(both.map((one, i) => track(one, robots[i].name, i, robots[i].bodies[brakes])));
      const charted = both.map((one, i) => rows(one, data.who[i]));
      await chart(charted, robots.map(({ values }) => stopsOf(values)), rough);
      roughness = rough;
      move(charted);
      said.textContent = inWords(robots, charted);
      fill(tables, robots, charted, held);
      root.dataset.shown = state; // what the pictures show now
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
        return view.resize().runAsync(); // the numbers beside an axis need other room
      }));
    }

    await update();
    replay.start();
  }

  start();
})();
