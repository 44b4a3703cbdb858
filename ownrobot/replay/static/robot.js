// A robot as meshes, made of the parts and rods that ownrobot/replay/skeleton.py lists. World: x ahead, y left, z up.
"use strict";

window.sidmRobot = (() => {
  const known = new Map(); // geometries and materials are shared by all robots and live as long as the page

  function shared(key, make) {
    if (!known.has(key)) known.set(key, make());
    return known.get(key);
  }

  /** A flat outline of (x, z), pulled along y and centred on it. */
  function pulled(shape, depth, bevel) {
    const options = { depth: depth - 2 * bevel, bevelThickness: bevel, bevelSize: bevel, bevelSegments: 1, curveSegments: 7 };
    const geometry = new THREE.ExtrudeGeometry(shape, { ...options, bevelEnabled: bevel > 0 });
    return geometry.translate(0, 0, bevel - depth / 2).rotateX(Math.PI / 2);
  }

  function ring(radius, holes, of) {
    const shape = new THREE.Shape().absarc(0, 0, radius, 0, 2 * Math.PI);
    for (let i = 0; i < holes.count; i++) {
      const angle = (2 * Math.PI * i) / holes.count;
      const [x, y] = [holes.at * of * Math.cos(angle), holes.at * of * Math.sin(angle)];
      shape.holes.push(new THREE.Path().absarc(x, y, holes.radius * of, 0, 2 * Math.PI, true));
    }
    return shape;
  }

  /** The tyre's tread: knobs around it, so that its turning is seen. */
  function tread(radius, knobs = 18) {
    const shape = new THREE.Shape();
    for (let i = 0; i < knobs; i++) {
      [[0, 0.93], [0.12, 1], [0.58, 1], [0.7, 0.93]].forEach(([share, out], corner) => {
        const angle = (2 * Math.PI * (i + share)) / knobs;
        const point = [radius * out * Math.cos(angle), radius * out * Math.sin(angle)];
        if (i + corner === 0) shape.moveTo(...point);
        else shape.lineTo(...point);
      });
    }
    shape.closePath();
    shape.holes.push(new THREE.Path().absarc(0, 0, 0.62 * radius, 0, 2 * Math.PI, true));
    return shape;
  }

  /** A spring's wire; made in its true size and then brought to radius 1 and length 1. */
  class Helix extends THREE.Curve {
    getPoint(share, target = new THREE.Vector3()) {
      const angle = 2 * Math.PI * 7 * share;
      return target.set(0.0165 * Math.cos(angle), 0.122 * (share - 0.5), 0.0165 * Math.sin(angle));
    }
  }

  const rod = () => shared("rod", () => new THREE.CylinderGeometry(1, 1, 1, 8, 1, true));
  const coil = () => shared("coil", () => new THREE.TubeGeometry(new Helix(), 63, 0.0026, 4).scale(1 / 0.0165, 1 / 0.122, 1 / 0.0165));

  /** Chamfered sides, the nose lower than the tail: one sees where it is heading. */
  function hull([long, wide, high]) {
    const [a, b] = [long / 2, high / 2];
    const outline = [[-a, -0.5 * b], [-0.9 * a, -b], [0.85 * a, -b], [a, -0.4 * b], [a, 0.05 * b], [0.72 * a, b], [-a, b]];
    const shape = new THREE.Shape();
    outline.forEach(([x, z], i) => (i ? shape.lineTo(x, -z) : shape.moveTo(x, -z)));
    shape.closePath();
    return pulled(shape, wide, Math.min(0.1 * high, 0.08 * wide));
  }

  /** Shapes of a part: what it looks like -> [geometry, paint, place] each. */
  const SHAPES = {
    body: ({ size }) => {
      const [long, wide, high] = size;
      const lid = shared(`lid ${size}`, () => new THREE.BoxGeometry(0.5 * long, 0.62 * wide, 0.12 * high));
      const glass = shared(`glass ${size}`, () => new THREE.BoxGeometry(0.02 * long, 0.6 * wide, 0.34 * high));
      return [
        [shared(`hull ${size}`, () => hull(size)), "body"],
        [lid, "dark", [-0.16 * long, 0, 0.54 * high]],
        [glass, "light", [0.497 * long, 0, -0.18 * high]],
      ];
    },
    tyre: ({ radius, width, side }) => {
      const name = `${radius} ${width}`;
      const holes = { count: 5, at: 0.36, radius: 0.125 };
      const out = side * 0.36 * width; // the rim stands where one sees it from outside
      return [
        [shared(`tyre ${name}`, () => pulled(tread(radius), width, 0.08 * radius)), "tyre"],
        [shared(`rim ${name}`, () => pulled(ring(0.63 * radius, holes, radius), 0.22 * width, 0)), "rim", [0, out, 0]],
        [shared(`cap ${name}`, () => pulled(ring(0.15 * radius, { count: 0 }, 1), 0.3 * width, 0)), "body", [0, out, 0]],
      ];
    },
    tube: ({ from, to, radius }) => {
      const [start, end] = [new THREE.Vector3(...from), new THREE.Vector3(...to)];
      const mesh = new THREE.Mesh(rod());
      lay(mesh, start, end, radius);
      return [[rod(), "metal", null, mesh]];
    },
  };

  const [up, along] = [new THREE.Vector3(0, 1, 0), new THREE.Vector3()]; // up: how a rod's geometry stands

  /** Put a mesh of length 1 along y between two points. */
  function lay(mesh, start, end, radius) {
    const length = along.subVectors(end, start).length();
    mesh.position.addVectors(start, end).multiplyScalar(0.5);
    mesh.quaternion.setFromUnitVectors(up, along.divideScalar(length));
    mesh.scale.set(radius, length, radius);
  }

  const PAINTS = { dark: 0x2b2e33, light: 0xf3efe2, tyre: 0x2a2b2e, rim: 0xc9ccd1, metal: 0x7d838b, spring: 0xe8c547, sleeve: 0x3c4148 };

  const CASTING = new Set(["body", "tyre", "sleeve"]); // the rest would be hardly seen in the shadow

  function paints(colour, ghost) {
    const found = {};
    for (const [name, own] of Object.entries({ ...PAINTS, body: colour })) {
      const tint = new THREE.Color(own);
      if (ghost) tint.lerp(new THREE.Color(colour), name === "tyre" ? 0.45 : 0.7);
      found[name] = new THREE.MeshLambertMaterial(ghost ? { color: tint, transparent: true, opacity: ghost } : { color: tint });
    }
    return found;
  }

  return class Robot {
    /** @param track what moves: {colour, ghost: opacity or 0, skeleton, step, moments, position, quaternion, joints} */
    constructor(track) {
      this.track = track;
      this.materials = shared(`paints ${track.colour} ${track.ghost}`, () => paints(track.colour, track.ghost));
      this.holder = new THREE.Group(); // stands in the world; the body moves in it
      this.body = new THREE.Group();
      this.holder.add(this.body);
      const { parts, rods } = track.skeleton;
      this.parts = parts.map((part) => this.build(part));
      parts.forEach(({ parent }, i) => (parent === undefined ? this.body : this.parts[parent]).add(this.parts[i]));
      this.moving = parts.flatMap((part, i) => part.joint === undefined ? [] : [[this.parts[i], new THREE.Vector3(...part.axis), part.joint]]);
      this.rods = rods.flatMap((one) => this.rod(one));
    }

    mesh(geometry, paint) {
      const made = new THREE.Mesh(geometry, this.materials[paint]);
      made.castShadow = !this.track.ghost && CASTING.has(paint);
      made.renderOrder = this.track.ghost ? 2 : 0;
      return made;
    }

    build({ at, shapes = [] }) {
      const group = new THREE.Group();
      group.position.set(...at);
      for (const shape of shapes) {
        for (const [geometry, paint, place, like] of SHAPES[shape.kind](shape)) {
          const mesh = this.mesh(geometry, paint);
          if (place) mesh.position.set(...place);
          if (like) mesh.copy(like, false).material = this.materials[paint];
          group.add(mesh);
        }
      }
      return group;
    }

    /** A link is one rod; a strut a sleeve, a rod and the spring around them. */
    rod({ kind, ends }) {
      const points = ends.map(([part, point]) => [this.parts[part], new THREE.Vector3(...point)]);
      const looks = kind === "strut"
        ? [[rod(), "sleeve", 0.011, 0, 0.55], [rod(), "rim", 0.006, 0.5, 1], [coil(), "spring", 0.0165, 0.12, 0.88]]
        : [[rod(), "metal", 0.006, 0, 1]];
      return looks.map(([geometry, paint, radius, from, to]) => {
        const mesh = this.mesh(geometry, paint);
        this.holder.add(mesh);
        return { mesh, points, radius, from, to };
      });
    }

    /** Where everything is after `time` seconds; after its last moment a robot stays. */
    place(time) {
      const { step, moments, position, quaternion, joints, joint } = this.track;
      const at = Math.min(Math.max(time / step, 0), moments - 1);
      const i = Math.min(Math.floor(at), Math.max(moments - 2, 0));
      const [share, next] = [at - i, Math.min(i + 1, moments - 1)];
      const between = (values, size, k) => values[i * size + k] * (1 - share) + values[next * size + k] * share;
      this.body.position.set(between(position, 3, 0), between(position, 3, 1), between(position, 3, 2));
      this.from ??= new THREE.Quaternion();
      this.from.fromArray(quaternion, 4 * i);
      this.body.quaternion.fromArray(quaternion, 4 * next);
      this.body.quaternion.slerpQuaternions(this.from, this.body.quaternion.clone(), share);
      for (const [part, axis, k] of this.moving) part.quaternion.setFromAxisAngle(axis, between(joints, joint, k));
      this.body.updateMatrixWorld(true);
      this.layRods();
    }

    layRods() {
      this.a ??= [0, 0, 0, 0].map(() => new THREE.Vector3());
      const [start, end, one, other] = this.a;
      for (const { mesh, points, radius, from, to } of this.rods) {
        start.copy(points[0][1]).applyMatrix4(points[0][0].matrixWorld);
        end.copy(points[1][1]).applyMatrix4(points[1][0].matrixWorld);
        lay(mesh, one.lerpVectors(start, end, from), other.lerpVectors(start, end, to), radius);
      }
    }

    dispose() {
      this.holder.removeFromParent();
    }
  };
})();
