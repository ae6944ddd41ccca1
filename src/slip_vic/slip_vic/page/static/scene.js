// One run as a scene: arms, pads, object, planned and walked path, trace of the pad on the object, slip velocity.

const ARM = 0, GRASP = 1; // layers: what each of the two cameras sees
const OBJECT_GRID = 0.02; // m
const ARROW = 0.06; // m, of the largest slip speed of all runs
const EVERY = 25; // frames: how often the places of the links are kept, for the camera

class RunScene {
  constructor(model, number, fastest) {
    const run = model.runs[number];
    this.model = model;
    this.run = run;
    this.number = number;
    this.fastest = fastest;
    this.scene = new THREE.Scene();
    this.light();
    this.floor();
    this.object = run.object ? this.makeObject(run.object) : null;
    this.arms = run.arms.map((arm) => this.makeArm(arm));
    this.reach();
  }

  light() {
    for (const light of [new THREE.HemisphereLight(0xffffff, 0x747b86, 0.8), new THREE.DirectionalLight(0xffffff, 0.46), new THREE.DirectionalLight(0xffffff, 0.2)]) {
      light.layers.enable(GRASP);
      this.scene.add(light);
      if (light.isDirectionalLight) light.position.set(...(light.intensity > 0.3 ? [1.2, -1.5, 2.5] : [-2, 2, 1]));
    }
  }

  floor() {
    const grid = new THREE.GridHelper(2.4, 24).rotateX(Math.PI / 2);
    this.floorGrid = grid;
    this.scene.add(grid);
  }

  makeObject(object) {
    const [x, y, z] = object.size;
    const geometry = new THREE.BoxGeometry(x, y, z);
    const sides = [[y, z], [y, z], [x, z], [x, z], [x, y], [x, y]]; // of the box's six faces: +x -x +y -y +z -z
    const group = new THREE.Group();
    const mesh = new THREE.Mesh(geometry, sides.map(([w, h], i) => new THREE.MeshLambertMaterial({ map: new THREE.CanvasTexture(faceTexture(w, h, i)) })));
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial());
    this.faces = mesh.material;
    this.faceSides = sides;
    this.objectEdges = edges.material;
    for (const part of [mesh, edges]) part.layers.enable(GRASP);
    group.add(mesh, edges);
    this.scene.add(group);
    return group;
  }

  makeArm(arm) {
    const robot = new Robot(arm);
    this.scene.add(robot.root);
    const own = { arm, robot, walked: new Track(0.004, 1e-3, ARM), trace: new Track(0.0014, 2e-4, GRASP), places: [], relative: new THREE.Matrix4() };
    this.scene.add(own.walked.mesh);
    this.planned(arm);
    own.pads = this.pads(robot);
    own.arrow = this.arrow();
    robot.tip.add(own.arrow);
    for (const link of robot.hand) {
      for (const mesh of link.children.filter((child) => child.isMesh)) {
        const lines = new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55, depthTest: false }));
        lines.position.copy(mesh.position);
        lines.quaternion.copy(mesh.quaternion);
        lines.layers.set(GRASP);
        lines.userData.hand = true;
        link.add(lines);
      }
    }
    if (this.object) {
      own.trace.mesh.material.depthTest = false;
      own.trace.mesh.material.transparent = true; // drawn after what is solid
      own.trace.mesh.renderOrder = 3;
      this.object.add(own.trace.mesh);
      own.outline = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(...this.run.object.size)), new THREE.LineDashedMaterial({ dashSize: 0.006, gapSize: 0.005, depthTest: false, transparent: true }));
      own.outline.computeLineDistances();
      own.outline.layers.set(GRASP);
      own.outline.matrixAutoUpdate = false;
      robot.tip.add(own.outline);
    }
    return own;
  }

  planned(arm) {
    const points = arm.planned.length > 3 ? arm.planned : []; // of one instant there is no path
    const dots = [];
    let since = 1;
    for (let i = 0; i + 2 < points.length; i += 3) {
      if (i) since += Math.hypot(points[i] - points[i - 3], points[i + 1] - points[i - 2], points[i + 2] - points[i - 1]);
      if (since > 0.016) { dots.push(i); since = 0; }
    }
    const mesh = new THREE.InstancedMesh(new THREE.SphereGeometry(0.0042, 8, 6), new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.75 }), Math.max(1, dots.length));
    dots.forEach((i, k) => mesh.setMatrixAt(k, new THREE.Matrix4().makeTranslation(points[i], points[i + 1], points[i + 2])));
    mesh.count = dots.length;
    mesh.frustumCulled = false;
    (this.plannedDots ??= []).push(mesh);
    this.scene.add(mesh);
  }

  pads(robot) {
    const [radius, thickness] = this.run.pad;
    const pads = [];
    for (const side of [1, -1]) {
      const geometry = new THREE.CylinderGeometry(radius, radius, thickness, 32).rotateX(Math.PI / 2);
      const solid = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: 0x2b2f36 }));
      const seen = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.28, depthTest: false }));
      seen.layers.set(GRASP);
      seen.userData.pad = true;
      for (const pad of [solid, seen]) {
        pad.userData.side = side;
        robot.tip.add(pad);
        pads.push(pad);
      }
    }
    return pads;
  }

  arrow() {
    const arrow = new THREE.Group();
    const material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true });
    arrow.userData.shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.0016, 0.0016, 1, 10).translate(0, 0.5, 0), material);
    arrow.userData.head = new THREE.Mesh(new THREE.ConeGeometry(0.0052, 0.013, 16), material);
    arrow.add(arrow.userData.shaft, arrow.userData.head);
    arrow.traverse((part) => { part.layers.enable(GRASP); part.renderOrder = 5; });
    arrow.userData.material = material;
    return arrow;
  }

  // -- the numbers of one frame ------------------------------------------------------------------------------------

  pose(frame) {
    if (this.object) {
      const p = this.run.object.pose, i = 7 * frame;
      if (Number.isFinite(p[i])) {
        this.object.position.set(p[i], p[i + 1], p[i + 2]);
        this.object.quaternion.set(p[i + 3], p[i + 4], p[i + 5], p[i + 6]);
      }
      this.object.updateMatrixWorld(true);
    }
    for (const own of this.arms) own.robot.pose(own.arm.q, own.arm.joints.length * frame);
  }

  // Follow frames [from, to): where the pad was, in the world and on the object.
  follow(from, to) {
    const point = new THREE.Vector3(), inverse = new THREE.Matrix4();
    for (let frame = from; frame < to; frame++) {
      this.pose(frame);
      const apart = window.slipLive && frame > 0 && this.model.time[frame] - this.model.time[frame - 1] > GAP;
      if (this.object) inverse.copy(this.object.matrixWorld).invert();
      for (const own of this.arms) {
        if (!Number.isFinite(own.arm.q[own.arm.joints.length * frame])) continue;
        if (frame % EVERY === 0) own.places.push(...own.robot.links.map((link) => new THREE.Vector3().setFromMatrixPosition(link.matrixWorld)));
        own.walked.add(point.setFromMatrixPosition(own.robot.tip.matrixWorld), frame, apart);
        if (!this.object || !Number.isFinite(this.run.object.pose[7 * frame])) continue;
        point.applyMatrix4(inverse);
        if (!own.known) this.grasped(own, inverse);
        own.trace.add(point.addScaledVector(own.normal, own.lift), frame, apart);
        point.setFromMatrixPosition(this.object.matrixWorld).applyMatrix4(inverse.copy(own.robot.tip.matrixWorld).invert());
        own.ways.expandByPoint(point);
        inverse.copy(this.object.matrixWorld).invert();
      }
    }
    for (const own of this.arms) { own.walked.build(); own.trace.build(); }
  }

  grasped(own, inverse) { // how the arm holds the object: from the first frame that shows both
    const tip = own.robot.tip.matrixWorld;
    own.relative.copy(inverse).multiply(tip).invert(); // object on the pad's axes
    own.outline.matrix.copy(own.relative);
    const e = own.relative.elements;
    const [x, y, z] = this.run.object.size;
    const half = 0.5 * (Math.abs(e[2]) * x + Math.abs(e[6]) * y + Math.abs(e[10]) * z);
    const off = e[14]; // centre of the object along the pads' normal
    own.normal = new THREE.Vector3(e[2], e[6], e[10]); // the pads' normal on the object's axes
    own.lift = (own.up = this.upwards(tip)) * half;
    for (const pad of own.pads) pad.position.z = off + pad.userData.side * (half + 0.5 * this.run.pad[1]);
    own.span = Math.max(Math.abs(e[0]) * x + Math.abs(e[4]) * y + Math.abs(e[8]) * z, Math.abs(e[1]) * x + Math.abs(e[5]) * y + Math.abs(e[9]) * z, 0.05);
    own.arrow.position.z = off + own.up * (half + this.run.pad[1]);
    own.ways = new THREE.Box2(); // where the object's centre has been, on the pad's axes
    own.known = true;
  }

  upwards(tip) { return tip.elements[10] >= -1e-3 ? 1 : -1; }

  show(frame) {
    this.pose(frame);
    for (const own of this.arms) {
      own.walked.until(frame);
      own.trace.until(frame);
      const s = own.arm.slip, i = 6 * frame;
      const speed = Math.hypot(s[i], s[i + 1], s[i + 2]);
      if (speed > this.fastest) this.fastest = speed;
      const length = Number.isFinite(speed) && this.fastest > 0 ? (ARROW * speed) / this.fastest : 0;
      own.arrow.visible = length > 0.002;
      if (own.arrow.visible) {
        own.arrow.userData.shaft.scale.y = length;
        own.arrow.userData.head.position.y = length;
        own.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(s[i], s[i + 1], s[i + 2]).normalize());
      }
    }
    this.scene.updateMatrixWorld(true);
  }

  reach() { // what the first camera looks at
    this.bounds = new THREE.Box3();
    this.scene.updateMatrixWorld(true);
  }

  paint() {
    const run = new THREE.Color(runColour(this.run));
    for (const own of this.arms) {
      own.walked.paint(run);
      own.trace.paint(run);
      own.arrow.userData.material.color.set(colour("ink"));
      if (own.outline) own.outline.material.color.set(colour("ink"));
      own.robot.root.traverse((part) => {
        if (part.userData.hand) part.material.color.set(colour("soft"));
        if (part.userData.pad) part.material.color.set(colour("ink"));
      });
    }
    for (const dots of this.plannedDots) dots.material.color.set(colour("planned"));
    this.floorGrid.material.vertexColors = false;
    this.floorGrid.material.color.set(colour("floor"));
    this.floorGrid.material.needsUpdate = true;
    if (this.object) {
      this.objectEdges.color.set(colour("objectline"));
      this.faces.forEach((face, i) => {
        face.map.dispose();
        face.map = new THREE.CanvasTexture(faceTexture(...this.faceSides[i], i));
        face.map.anisotropy = 4;
        face.needsUpdate = true;
      });
    }
  }
}

function faceTexture(width, height, face) { // lines every 20 mm, counted from the middle, which is marked
  const scale = Math.min(3000, 512 / Math.max(width, height, 1e-3)); // pixels per metre
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(4, Math.round(width * scale));
  canvas.height = Math.max(4, Math.round(height * scale));
  const pen = canvas.getContext("2d");
  pen.fillStyle = colour("object");
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = colour("objectline");
  pen.globalAlpha = 0.5;
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (const [length, across] of [[width, true], [height, false]]) {
    for (let k = -Math.floor(length / 2 / OBJECT_GRID); k <= length / 2 / OBJECT_GRID; k++) {
      const at = (length / 2 + k * OBJECT_GRID) * scale;
      if (across) { pen.moveTo(at, 0); pen.lineTo(at, canvas.height); } else { pen.moveTo(0, at); pen.lineTo(canvas.width, at); }
    }
  }
  pen.stroke();
  return canvas;
}

class Track { // a line with a width that grows with time: points with the frame at which each was reached
  constructor(radius, step, layer) {
    this.radius = radius;
    this.step = step;
    this.points = [];
    this.frames = [];
    this.apart = [];
    this.built = 0;
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial());
    this.mesh.frustumCulled = false;
    this.mesh.layers.set(layer);
  }

  add(point, frame, apart = false) { // apart: no line from the point before to this one
    const last = this.points[this.points.length - 1];
    if (last && last.distanceTo(point) < this.step) return;
    this.points.push(point.clone());
    this.frames.push(frame);
    this.apart.push(apart);
  }

  build() {
    const n = this.points.length, sides = 6;
    if (n === this.built || n < 2) return;
    this.built = n;
    const position = new Float32Array(3 * sides * n), index = new Uint32Array(6 * sides * (n - 1));
    const along = new THREE.Vector3(), first = new THREE.Vector3(), second = new THREE.Vector3();
    for (let i = 0; i < n; i++) {
      along.subVectors(this.points[Math.min(i + 1, n - 1)], this.points[Math.max(i - 1, 0)]).normalize();
      first.set(...(Math.abs(along.z) < 0.9 ? [0, 0, 1] : [1, 0, 0])).cross(along).normalize();
      second.crossVectors(along, first);
      for (let k = 0; k < sides; k++) {
        const angle = (2 * Math.PI * k) / sides, c = this.radius * Math.cos(angle), s = this.radius * Math.sin(angle);
        const p = this.points[i], at = 3 * (sides * i + k);
        position[at] = p.x + c * first.x + s * second.x;
        position[at + 1] = p.y + c * first.y + s * second.y;
        position[at + 2] = p.z + c * first.z + s * second.z;
        if (i === n - 1 || this.apart[i + 1]) continue;
        const a = sides * i + k, b = sides * i + ((k + 1) % sides);
        index.set([a, a + sides, b, b, a + sides, b + sides], 6 * (sides * i + k));
      }
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new THREE.BufferGeometry();
    this.mesh.geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    this.mesh.geometry.setIndex(new THREE.BufferAttribute(index, 1));
  }

  until(frame) {
    let low = 0, high = this.frames.length;
    while (low < high) { const middle = (low + high) >> 1; if (this.frames[middle] <= frame) low = middle + 1; else high = middle; }
    this.mesh.visible = this.built > 1;
    this.mesh.geometry.setDrawRange(0, 36 * Math.max(0, Math.min(low, this.built) - 1));
  }

  paint(with_) { this.mesh.material.color.copy(with_); }

  cut(frames) { // the oldest frames are gone: forget them
    const keep = this.frames.findIndex((frame) => frame >= frames);
    const from = keep < 0 ? this.frames.length : keep;
    this.points.splice(0, from);
    this.apart.splice(0, from);
    this.frames = this.frames.slice(from).map((frame) => frame - frames);
    this.built = 0;
  }
}
