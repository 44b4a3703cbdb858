// Ground as a shaded mesh with contour lines, and the marks that robots leave on it.
"use strict";

window.sidmGround = (() => {
  const LOOKS = {
    light: { low: 0x9aa583, middle: 0xcdbd97, high: 0xf1ebdd, line: 0x5d5238 },
    dark: { low: 0x3f4a42, middle: 0x6b6252, high: 0x9b9484, line: 0xd8cdb0 },
  };
  const CONTOUR = 0.1; // m from line to line; every fifth is stronger
  const TILE = 24; // cells a side of a piece of the mesh
  const [TRAIL, FINER] = [0.018, 4]; // m, half as wide as a trail is; its pieces a moment

  /** Of a number that grows over the ground: how near it is to a whole one, as lines of so many pixels. */
  const LINES = `float lines(float level, float wide) {
    return 1.0 - min(abs(fract(level - 0.5) - 0.5) / (wide * max(fwidth(level), 1e-4)), 1.0);
  }`;
  const CONTOURS = `float level = vGround.z / ${CONTOUR.toFixed(3)};
    float near = clamp(1.3 - 1.6 * fwidth(level), 0.0, 1.0);
    float drawn = max(0.42 * lines(level, 1.0), 0.75 * lines(level / 5.0, 1.7)) * near;`;
  const METRES = `float near = clamp(1.3 - 3.0 * max(fwidth(vGround.x), fwidth(vGround.y)), 0.0, 1.0);
    float drawn = 0.35 * max(lines(vGround.x, 1.0), lines(vGround.y, 1.0)) * near;`; // on level ground

  /** Lines in the shader: as wide as a pixel wherever the camera stands. */
  function withLines(material, uniforms, level) {
    material.customProgramCacheKey = () => `lines ${level}`;
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, uniforms);
      shader.vertexShader = `varying vec3 vGround;\n${shader.vertexShader}`.replace(
        "#include <begin_vertex>", "#include <begin_vertex>\n vGround = position;");
      const mixed = `#include <color_fragment>\n${level ? METRES : CONTOURS}
        diffuseColor.rgb = mix(diffuseColor.rgb, line, drawn);`;
      shader.fragmentShader = `uniform vec3 line;\nvarying vec3 vGround;\n${LINES}\n${shader.fragmentShader}`
        .replace("#include <color_fragment>", mixed);
    };
    return material;
  }

  const known = new Map(); // materials of trails, which live as long as the page

  function trailMaterial(colour, ghost) {
    const name = `${colour} ${ghost}`;
    const looks = { color: colour, transparent: true, opacity: ghost ? 0.55 : 0.85, side: THREE.DoubleSide };
    if (!known.has(name)) known.set(name, new THREE.MeshBasicMaterial(looks));
    return known.get(name);
  }

  return class Ground {
    /** @param from {rows, columns, spacing, left, low, heights: metres, row by row} */
    constructor(from) {
      Object.assign(this, from);
      this.line = { value: new THREE.Color() };
      const whole = new THREE.BufferGeometry();
      whole.setAttribute("position", new THREE.BufferAttribute(this.points(), 3));
      whole.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * this.rows * this.columns), 3));
      whole.setIndex(new THREE.BufferAttribute(this.triangles(0, 0, this.rows, this.columns), 1));
      whole.computeVertexNormals();
      this.attributes = whole.attributes;
      const level = this.heights.every((height) => height === this.heights[0]);
      this.material = withLines(new THREE.MeshLambertMaterial({ vertexColors: true }), { line: this.line }, level);
      this.mesh = new THREE.Group();
      for (let i = 0; i < this.rows - 1; i += TILE) for (let j = 0; j < this.columns - 1; j += TILE) this.addTile(i, j);
    }

    /** A piece of the mesh, to be left out where the camera does not see it. */
    addTile(i, j) {
      const geometry = new THREE.BufferGeometry();
      for (const [name, values] of Object.entries(this.attributes)) geometry.setAttribute(name, values);
      const index = this.triangles(i, j, Math.min(i + TILE + 1, this.rows), Math.min(j + TILE + 1, this.columns));
      geometry.setIndex(new THREE.BufferAttribute(index, 1));
      const points = Array.from(new Set(index), (k) => new THREE.Vector3().fromArray(this.attributes.position.array, 3 * k));
      geometry.boundingSphere = new THREE.Sphere().setFromPoints(points);
      const tile = new THREE.Mesh(geometry, this.material);
      tile.receiveShadow = true;
      this.mesh.add(tile);
    }

    dispose() {
      this.mesh.removeFromParent();
      this.mesh.children.forEach((tile) => tile.geometry.dispose());
      this.material.dispose();
    }

    points() {
      const points = new Float32Array(3 * this.rows * this.columns);
      this.heights.forEach((height, i) => {
        points[3 * i] = this.left + this.spacing * (i % this.columns);
        points[3 * i + 1] = this.low + this.spacing * Math.floor(i / this.columns);
        points[3 * i + 2] = height;
      });
      return points;
    }

    /** Those between rows and columns, two to a cell, cut as the simulation cuts them. */
    triangles(low, left, high, right) {
      const found = [];
      for (let i = low; i < high - 1; i++) {
        for (let j = left; j < right - 1; j++) {
          const k = i * this.columns + j;
          found.push(k, k + 1, k + this.columns, k + this.columns + 1, k + this.columns, k + 1);
        }
      }
      return new Uint32Array(found);
    }

    paint(scheme) {
      const look = LOOKS[scheme];
      const [low, middle, high] = [look.low, look.middle, look.high].map((colour) => new THREE.Color(colour));
      const sorted = Float32Array.from(this.heights).sort();
      const [bottom, top] = [0.03, 0.97].map((share) => sorted[Math.floor(share * (sorted.length - 1))]);
      const reach = Math.max(top - bottom, 0.15);
      const level = top === bottom ? 0.5 : 0;
      const { color } = this.attributes;
      const mixed = new THREE.Color();
      this.heights.forEach((height, i) => {
        const share = Math.min(Math.max(level + (height - bottom) / reach, 0), 1);
        if (share < 0.5) mixed.lerpColors(low, middle, 2 * share);
        else mixed.lerpColors(middle, high, 2 * share - 1);
        mixed.toArray(color.array, 3 * i);
      });
      color.needsUpdate = true;
      this.line.value.set(look.line);
    }

    heightAt(x, y) {
      const clamp = (value, most) => Math.min(Math.max(value, 0), most - 1.001);
      const [u, v] = [clamp((x - this.left) / this.spacing, this.columns), clamp((y - this.low) / this.spacing, this.rows)];
      const [j, i] = [Math.floor(u), Math.floor(v)];
      const at = (row, column) => this.heights[(i + row) * this.columns + j + column];
      const [p, q] = [u - j, v - i];
      return (at(0, 0) * (1 - p) + at(0, 1) * p) * (1 - q) + (at(1, 0) * (1 - p) + at(1, 1) * p) * q;
    }

    /** A ribbon on the ground under a robot's way, above those of lower numbers; `upTo` shows it to a moment. */
    trail({ position, moments, step, colour, ghost }, number) {
      const way = new THREE.CatmullRomCurve3(Array.from({ length: moments }, (_, i) => new THREE.Vector3().fromArray(position, 3 * i)));
      const count = FINER * (moments - 1) + 1;
      const points = new Float32Array(6 * count);
      const [at, along] = [new THREE.Vector3(), new THREE.Vector3()];
      for (let i = 0; i < count; i++) {
        way.getPoint(i / (count - 1), at);
        way.getTangent(i / (count - 1), along);
        const length = Math.hypot(along.x, along.y) || 1;
        [-1, 1].forEach((side, k) => {
          const [x, y] = [at.x - (side * TRAIL * along.y) / length, at.y + (side * TRAIL * along.x) / length];
          points.set([x, y, this.heightAt(x, y) + 0.012 + 0.004 * number], 6 * i + 3 * k);
        });
      }
      const index = Array.from({ length: count - 1 }, (_, i) => [2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3, 2 * i + 2, 2 * i + 1]);
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
      geometry.setIndex(index.flat());
      const mesh = new THREE.Mesh(geometry, trailMaterial(colour, ghost));
      mesh.renderOrder = 1;
      mesh.upTo = (time) => geometry.setDrawRange(0, 6 * Math.min(Math.floor((FINER * time) / step), count - 1));
      return mesh;
    }
  };
})();
