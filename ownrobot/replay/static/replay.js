// Rides in three dimensions: sidmReplay(element, options) puts the view and its controls into an element.
"use strict";

window.sidmReplay = (() => {
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
  const SLOW = 31; // ms a frame, above which fewer pixels are drawn
  const HELD = 0.9; // s that the last moment stays before the ride begins again
  const [BASIC, SOFT] = [0, 1]; // three.js' BasicShadowMap and PCFShadowMap
  const SKY = { light: 0xe9eef2, dark: 0x12161b };
  const KEYS = "Space plays and pauses; arrows turn the view; + and − go nearer and farther; , and . step in time; "
    + "[ and ] change the speed; Home goes to the start; F follows the robot or lets it go.";
  const PANELS = { ghost: "in one picture", beside: "side by side", first: "the first alone" };

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) if (value !== null) made.setAttribute(key, value);
    made.append(...children);
    return made;
  }

  const asks = (query) => window.matchMedia(`(${query})`).matches;

  function scheme() {
    const theme = document.documentElement.dataset.theme; // of the book
    if (theme) return theme === "dark" ? "dark" : "light";
    return asks("prefers-color-scheme: dark") ? "dark" : "light";
  }

  /** What draws here: a 'card', the 'processor', for which smooth edges and soft shadows take too long, or null. */
  function drawnBy() {
    if (drawnBy.known === undefined) {
      const gl = document.createElement("canvas").getContext("webgl2");
      const asked = gl?.getExtension("WEBGL_debug_renderer_info");
      const name = asked ? gl.getParameter(asked.UNMASKED_RENDERER_WEBGL) : "";
      gl?.getExtension("WEBGL_lose_context")?.loseContext();
      drawnBy.known = gl && (/swiftshader|llvmpipe|software|basic render/i.test(name) ? "processor" : "card");
    }
    return drawnBy.known;
  }

  /** What is packed by ownrobot.replay.viewer: numbers (series, moments, channels) of 16 bits. */
  async function unpack(text, moments, channels) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const count = planes.length / 2;
    const series = count / moments / channels;
    const numbers = new Int16Array(count);
    for (let i = 0, from = 0; i < channels * series; i++) {
      const [channel, one] = [Math.floor(i / series), i % series];
      for (let moment = 0, slope = 0, value = 0; moment < moments; moment++, from++) {
        const zigzag = planes[from] | (planes[count + from] << 8);
        slope += (zigzag >> 1) ^ -(zigzag & 1);
        value += slope;
        numbers[(one * moments + moment) * channels + channel] = value; // wraps as it did when packed
      }
    }
    return numbers;
  }

  /** A track of a scene's JSON, its motion unpacked: x, y, z, qx, qy, qz, qw, then the joints. */
  async function track({ motion, scales, ...rest }) {
    const [moments, channels] = [rest.moments, scales.length];
    const numbers = await unpack(motion, moments, channels);
    const part = (from, to) => Float32Array.from({ length: moments * (to - from) }, (_, i) => {
      const channel = from + (i % (to - from));
      return numbers[Math.floor(i / (to - from)) * channels + channel] / scales[channel];
    });
    return { ...rest, position: part(0, 3), quaternion: part(3, 7), joints: part(7, channels), joint: channels - 7 };
  }

  async function ground({ motion, scale, ...rest }) {
    return { ...rest, heights: Float32Array.from(await unpack(motion, rest.columns, 1), (number) => number / scale) };
  }

  const KEPT = 12; // pieces, the latest
  const pieces = new Map(); // name -> promise
  const folder = document.currentScript?.src ? new URL(".", document.currentScript.src) : null;

  /** What a script beside this one holds, loaded once: pages from a disk may load scripts, but not fetch. */
  function piece(name, make) {
    const known = pieces.get(name) ?? new Promise((resolve, reject) => {
      const script = element("script", { src: new URL(`${name}.js`, folder) });
      window.sidmPieces ??= {};
      window.sidmPieces[name] = (content) => {
        delete window.sidmPieces[name];
        script.remove();
        resolve(make(content));
      };
      script.addEventListener("error", (event) => {
        pieces.delete(name); // the next one who needs it tries again
        script.remove();
        reject(event);
      });
      document.head.append(script);
    });
    pieces.delete(name);
    pieces.set(name, known); // to the end: the one that was needed last
    if (pieces.size > KEPT) pieces.delete(pieces.keys().next().value);
    return known;
  }

  class Replay {
    constructor(root, { label = "Robots driving over rough ground", film = null, distance = 2.4 } = {}) {
      [this.root, this.robots, this.trails, this.listeners] = [root, [], [], []];
      [this.time, this.duration, this.speed, this.playing, this.follow, this.panels] = [0, 0, 1, false, true, "ghost"];
      this.camera = { azimuth: -2.35, elevation: 0.36, distance };
      this.held = 0;
      root.classList.add("replay");
      this.screen = element("div", { class: "replay-screen", tabindex: "0", role: "application", "aria-label": label });
      this.names = element("ul", { class: "replay-names" });
      root.replaceChildren(this.screen, this.names);
      if (!drawnBy()) {
        root.classList.add("replay-without");
        this.screen.removeAttribute("tabindex");
        this.screen.setAttribute("role", "group");
        this.screen.replaceChildren(...(film ? [element("img", { src: film, alt: label })] : []),
          element("p", {}, "This browser draws no WebGL, which the replay needs."));
        return;
      }
      this.plain = drawnBy() === "processor";
      this.renderer = new THREE.WebGLRenderer({ antialias: !this.plain, powerPreference: "low-power" });
      this.stage();
      this.controls();
      this.listen();
    }

    get drawn() {
      return this.renderer !== undefined;
    }

    /** Scene, lights and camera. */
    stage() {
      const { renderer } = this;
      renderer.shadowMap.enabled = true;
      renderer.shadowMap.type = this.plain ? BASIC : SOFT;
      this.ratio = this.plain ? 1 : Math.min(window.devicePixelRatio, 2);
      renderer.setPixelRatio(this.ratio);
      renderer.autoClear = false;
      renderer.domElement.setAttribute("aria-hidden", "true");
      this.screen.append(renderer.domElement);
      this.scene = new THREE.Scene();
      this.scene.fog = new THREE.Fog(0, 9, 20);
      this.lens = new THREE.PerspectiveCamera(38, 16 / 9, 0.05, 60);
      this.lens.up.set(0, 0, 1);
      this.sky = new THREE.HemisphereLight(0xffffff, 0x8a7f68, 1.5);
      this.sun = new THREE.DirectionalLight(0xfff1d6, 2.2);
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.setScalar(this.plain ? 512 : 1024);
      this.sun.shadow.bias = -0.002;
      this.target = new THREE.Vector3();
      this.scene.add(this.sky, this.sun, this.sun.target);
      this.paint();
    }

    paint() {
      const colour = scheme();
      this.scene.background = this.scene.fog.color = new THREE.Color(SKY[colour]);
      this.sky.intensity = colour === "dark" ? 1.0 : 1.5;
      this.ground?.paint(colour);
      this.dirty = true;
    }

    controls() {
      const button = element("button", { type: "button", class: "replay-play" }, "Play");
      const scrub = element("input", { type: "range", min: 0, max: 1, step: 0.01, value: 0, "aria-label": "time", class: "replay-scrub" });
      const clock = element("span", { class: "replay-clock" }, "0.00 s");
      const speed = element("select", { "aria-label": "speed" },
        ...SPEEDS.map((value) => element("option", { value }, `${value} ×`)));
      speed.value = 1;
      const follow = element("input", { type: "checkbox", checked: "" });
      const panels = element("select", { "aria-label": "both robots" },
        ...Object.entries(PANELS).map(([value, words]) => element("option", { value }, words)));
      this.control = { button, scrub, clock, speed, follow, panels };
      this.bar = element("div", { class: "replay-bar", role: "group", "aria-label": "replay" }, button, scrub, clock, speed, panels,
        element("label", { class: "replay-follow" }, follow, "follow"));
      this.screen.after(this.bar);
      const help = element("details", { class: "replay-keys" }, element("summary", {}, "Keys"),
        element("p", {}, `Drag to turn the view, pinch or turn the wheel to come nearer. In the picture: ${KEYS}`));
      this.root.append(help);
      button.addEventListener("click", () => this.play(!this.playing));
      scrub.addEventListener("input", () => this.seek(scrub.valueAsNumber));
      speed.addEventListener("change", () => (this.speed = Number(speed.value)));
      follow.addEventListener("change", () => (this.follow = follow.checked));
      panels.addEventListener("change", () => this.arrange(panels.value));
    }

    listen() {
      const { screen } = this;
      const fingers = new Map();
      const spread = () => {
        const [a, b] = [...fingers.values()];
        return Math.hypot(a.x - b.x, a.y - b.y);
      };
      screen.addEventListener("pointerdown", (event) => {
        screen.setPointerCapture(event.pointerId);
        fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      });
      screen.addEventListener("pointermove", (event) => {
        const last = fingers.get(event.pointerId);
        if (!last) return;
        const before = fingers.size === 2 ? spread() : 0;
        fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        if (before) this.nearer(before / spread());
        else this.turn(-0.008 * (event.clientX - last.x), 0.006 * (event.clientY - last.y));
      });
      for (const end of ["pointerup", "pointercancel"]) screen.addEventListener(end, (event) => fingers.delete(event.pointerId));
      screen.addEventListener("wheel", (event) => {
        if (document.activeElement !== screen) return; // the page scrolls until the picture is chosen
        event.preventDefault();
        this.nearer(Math.exp(0.001 * event.deltaY));
      }, { passive: false });
      screen.addEventListener("keydown", (event) => this.key(event));
      new ResizeObserver(() => this.fit()).observe(screen);
      new IntersectionObserver(([entry]) => {
        this.seen = entry.isIntersecting;
        if (this.seen) this.run();
      }).observe(screen);
      new MutationObserver(() => this.paint()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
      window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint());
    }

    key(event) {
      const { control } = this;
      const step = (select, by) => {
        select.selectedIndex = Math.min(Math.max(select.selectedIndex + by, 0), select.length - 1);
        select.dispatchEvent(new Event("change"));
      };
      const does = {
        " ": () => this.play(!this.playing),
        ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0),
        ArrowUp: () => this.turn(0, 0.08), ArrowDown: () => this.turn(0, -0.08),
        "+": () => this.nearer(0.88), "=": () => this.nearer(0.88), "-": () => this.nearer(1.14),
        ",": () => this.seek(this.time - 0.05), ".": () => this.seek(this.time + 0.05), Home: () => this.seek(0),
        "[": () => step(control.speed, -1), "]": () => step(control.speed, 1),
        f: () => control.follow.click(),
      }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      does();
    }

    turn(azimuth, elevation) {
      this.camera.azimuth += azimuth;
      this.camera.elevation = Math.min(Math.max(this.camera.elevation + elevation, 0.05), 1.5);
      this.dirty = true;
    }

    nearer(factor) {
      this.camera.distance = Math.min(Math.max(this.camera.distance * factor, 0.6), 14);
      this.dirty = true;
    }

    /** Other ground; the robots stay. */
    setGround(from) {
      if (!this.drawn) return;
      this.ground?.dispose();
      this.ground = new window.sidmGround(from);
      this.scene.add(this.ground.mesh);
      this.paint();
    }

    /** Other rides, at the moment that is shown: the first is the one that matters. */
    setTracks(tracks) {
      this.duration = Math.max(...tracks.map(({ step, moments }) => step * (moments - 1)));
      this.nameThem(tracks);
      if (!this.drawn) return;
      this.robots.forEach((robot) => robot.dispose());
      for (const trail of this.trails) {
        trail.removeFromParent();
        trail.geometry.dispose();
      }
      this.given = tracks;
      const shown = tracks.map((one) => (this.panels === "beside" ? { ...one, ghost: 0 } : one)); // none is in another's way
      this.robots = shown.map((one) => new window.sidmRobot(one));
      this.trails = shown.map((one, number) => this.ground.trail(one, number));
      this.scene.add(...this.robots.map(({ holder }) => holder), ...this.trails);
      this.control.scrub.max = this.duration;
      this.control.panels.hidden = tracks.length < 2;
      this.settled = this.settled && tracks.length > 0;
      this.seek(Math.min(this.time, this.duration));
    }

    nameThem(tracks) {
      this.numbers = tracks.map(() => element("span", { class: "replay-numbers" }));
      this.names.replaceChildren(...tracks.map(({ name, colour, ghost }, i) => element("li", {},
        element("span", { class: ghost ? "replay-swatch replay-ghost" : "replay-swatch", style: `--colour: ${colour}` }),
        element("span", { class: "replay-name" }, name), this.numbers[i])));
    }

    arrange(panels) {
      this.panels = panels;
      this.control.panels.value = panels;
      this.setTracks(this.given);
    }

    play(on = true) {
      if (!this.drawn) return;
      this.playing = on;
      if (on && this.time >= this.duration) this.seek(0);
      this.control.button.textContent = on ? "Pause" : "Play";
      this.root.dataset.playing = on;
      if (!on) this.sharpen();
      this.run();
    }

    /** Play from the beginning, unless one asked for less motion. */
    start() {
      if (!asks("prefers-reduced-motion: reduce")) this.play();
    }

    seek(time) {
      this.time = Math.min(Math.max(time, 0), this.duration);
      this.held = 0;
      this.dirty = true;
      if (!this.playing) this.report();
      this.run();
    }

    onTime(listener) {
      this.listeners.push(listener);
    }

    /** Frames are asked for only while somebody sees them. */
    run() {
      if (this.running || !this.drawn) return;
      this.running = true;
      let last = performance.now();
      const frame = (now) => {
        this.ease(now - last);
        this.advance(Math.min((now - last) / 1000, 0.1));
        last = now;
        if (this.dirty) this.draw();
        this.running = this.seen && (this.playing || this.dirty);
        if (this.running) requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }

    /** Without a graphics card, fewer pixels rather than fewer frames; a still picture has all of them. */
    ease(milliseconds) {
      const ratio = this.renderer.getPixelRatio();
      if (!this.plain || !this.playing) {
        this.sharpen();
        return;
      }
      this.pace = 0.9 * (this.pace ?? 25) + 0.1 * milliseconds;
      if (this.pace < SLOW || ratio < 0.6) return;
      this.pace = 25;
      this.renderer.setPixelRatio(0.85 * ratio);
    }

    sharpen() {
      if (this.renderer.getPixelRatio() === this.ratio) return;
      this.renderer.setPixelRatio(this.ratio);
      this.dirty = true;
    }

    advance(seconds) {
      if (!this.playing || !this.robots.length) return;
      this.dirty = true;
      if (this.time < this.duration) this.time = Math.min(this.time + this.speed * seconds, this.duration);
      else if ((this.held += seconds) > HELD) [this.time, this.held] = [0, 0];
    }

    fit() {
      const { clientWidth, clientHeight } = this.screen;
      if (!clientWidth) return;
      this.renderer.setSize(clientWidth, clientHeight, false);
      this.dirty = true;
      this.run();
    }

    /** Put everything where it is at this time, and draw it. */
    draw() {
      this.dirty = false;
      if (!this.robots.length) return;
      this.robots.forEach((robot) => robot.place(this.time));
      this.trails.forEach((trail) => trail.upTo(this.time));
      const { width, height } = this.renderer.domElement;
      const ratio = this.renderer.getPixelRatio();
      const [w, h] = [width / ratio, height / ratio];
      const beside = this.panels === "beside" && this.robots.length > 1;
      const shown = beside ? this.robots.map((_, i) => [i]) : [this.panels === "first" ? [0] : this.robots.map((_, i) => i)];
      this.renderer.setScissorTest(beside);
      shown.forEach((numbers, i) => {
        this.robots.forEach((robot, k) => (robot.holder.visible = this.trails[k].visible = numbers.includes(k)));
        const [across, down] = beside ? (w > 1.2 * h ? [1 / shown.length, 1] : [1, 1 / shown.length]) : [1, 1];
        const box = [across < 1 ? i * across * w : 0, down < 1 ? (shown.length - 1 - i) * down * h : 0, across * w, down * h];
        this.renderer.setViewport(...box);
        this.renderer.setScissor(...box);
        this.look(numbers, (across * w) / (down * h), beside || !this.settled);
        this.renderer.clear();
        this.renderer.render(this.scene, this.lens);
      });
      this.report();
    }

    /** The camera looks at the middle of the robots shown, from as far as shows them all. */
    look(numbers, aspect, at_once) {
      const { azimuth, elevation, distance } = this.camera;
      const places = numbers.map((number) => this.robots[number].body.position);
      const [low, high] = [Math.min, Math.max].map((pick) => ["x", "y", "z"].map((k) => pick(...places.map((p) => p[k]))));
      const wanted = new THREE.Vector3(...low.map((value, k) => (value + high[k]) / 2));
      const spread = Math.hypot(...low.map((value, k) => high[k] - value));
      if (this.follow || at_once) {
        const calm = at_once || !this.playing || asks("prefers-reduced-motion: reduce") ? 1 : 0.2;
        this.target.lerp(wanted, calm);
        this.settled = true;
      }
      const away = Math.max(distance, this.follow ? 0.9 * spread + 0.65 * distance : 0) * Math.max(1, 1.25 / aspect);
      const flat = away * Math.cos(elevation);
      const { target, lens } = this;
      lens.position.set(target.x + flat * Math.cos(azimuth), target.y + flat * Math.sin(azimuth), target.z + away * Math.sin(elevation));
      lens.position.z = Math.max(lens.position.z, this.ground.heightAt(lens.position.x, lens.position.y) + 0.2);
      lens.aspect = aspect;
      lens.updateProjectionMatrix();
      lens.lookAt(target);
      this.scene.fog.near = 1.6 * away + 4;
      this.scene.fog.far = 3 * away + 13;
      const middle = numbers.length > 1 ? target : places[0];
      const size = Math.max(0.5 * distance, 0.7 * spread + 0.35 * distance); // of the shadows
      Object.assign(this.sun.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: 0.1, far: 5 * size });
      this.sun.shadow.camera.updateProjectionMatrix();
      this.sun.position.set(middle.x - 0.9 * size, middle.y - 1.4 * size, middle.z + 2.1 * size);
      this.sun.target.position.copy(middle);
    }

    /** The time and the numbers beside the picture. */
    report() {
      if (!this.drawn) {
        this.listeners.forEach((listener) => listener(this.time));
        return;
      }
      const { scrub, clock } = this.control;
      scrub.value = this.time;
      const words = `${this.time.toFixed(2)} s`;
      clock.textContent = words;
      scrub.setAttribute("aria-valuetext", words);
      const first = this.robots[0]?.body.position;
      this.robots.forEach(({ body, track }, i) => {
        const [x, y] = [body.position.x - track.position[0], body.position.y - track.position[1]];
        const apart = i ? `, ${first.distanceTo(body.position).toFixed(2)} m from the first` : "";
        this.numbers[i].textContent = `${Math.hypot(x, y).toFixed(2)} m from the start${apart}`;
      });
      this.listeners.forEach((listener) => listener(this.time));
    }
  }

  /** A view in an element, with nothing in it yet. */
  function sidmReplay(root, options = {}) {
    const view = new Replay(root, options);
    root.replay = view;
    return view;
  }

  /** All of a scene's JSON, unpacked. */
  async function whole({ ground: from, tracks, ...options }) {
    return { ...options, ground: await ground(from), tracks: await Promise.all(tracks.map(track)) };
  }

  /** A view of a scene's JSON; it plays where motion is welcome. */
  async function scene(root, json) {
    const { ground: below, tracks, ...options } = await whole(json);
    const view = sidmReplay(root, options);
    view.setGround(below);
    view.setTracks(tracks);
    view.start();
    return view;
  }

  /** A view of one of several scenes, {name of its piece: words}, with a menu to choose it. */
  async function choice(root, names, options = {}) {
    const view = sidmReplay(root, options);
    const menu = element("select", { "aria-label": "what drives", class: "replay-choice" },
      ...Object.entries(names).map(([value, words]) => element("option", { value }, words)));
    async function show() {
      const asked = menu.value;
      const { ground: below, tracks, distance, label } = await piece(asked, whole);
      if (asked !== menu.value) return; // another one was chosen meanwhile
      view.screen.setAttribute("aria-label", label);
      view.camera.distance = distance;
      view.settled = false;
      view.setGround(below);
      view.setTracks(tracks);
      view.seek(0);
      root.dataset.shown = asked;
    }
    menu.addEventListener("change", show);
    root.prepend(menu);
    await show();
    view.start();
    return view;
  }

  Object.assign(sidmReplay, { unpack, ground, element, piece, scene, choice });
  return sidmReplay;
})();
