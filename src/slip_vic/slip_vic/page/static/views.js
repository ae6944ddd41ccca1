// One WebGL context draws every picture; each picture is a plain canvas on the page, so that they scroll with it.

const ROOM = 0.12; // [m] around link origins: what a link has beside its axis
const MOST = 1000; // places of links that are looked at
const START = { azimuth: 0.3, height: 0.5, zoom: 1 };

class Renderer {
  constructor() {
    this.gl = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.gl.setPixelRatio(1);
  }

  // Without a GPU a picture takes longer than a frame: what is drawn before it is finished piles up, and the page stops.
  get busy() {
    const gl = this.gl.getContext();
    if (this.fence && gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return true;
    gl.deleteSync?.(this.fence ?? null);
    this.fence = null;
    return false;
  }

  done() {
    const gl = this.gl.getContext();
    this.fence = gl.fenceSync?.(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  draw(canvas, scene, camera) {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return null;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const size = this.gl.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) this.gl.setSize(width, height, false);
    this.gl.render(scene, camera);
    const pen = canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    pen.drawImage(this.gl.domElement, 0, 0);
    return { pen, width, height, ratio };
  }
}

class Views {
  constructor(scenes, canvases, redraw) {
    this.scenes = scenes;
    this.canvases = canvases; // per run: {arm, grasp: [one per arm]}
    this.redraw = redraw;
    this.view = { ...START };
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.05, 20);
    this.camera.up.set(0, 0, 1);
    this.close = new THREE.OrthographicCamera(-1, 1, 1, -1, -0.6, 0.6);
    this.close.layers.set(GRASP);
    this.close.matrixAutoUpdate = false;
    this.renderer = new Renderer();
    for (const pair of canvases) this.turnable(pair.arm);
  }

  fit(keep = false) { // every run is seen with the same camera: it looks at all of them
    const points = [];
    for (const scene of this.scenes) {
      for (const own of scene.arms) {
        own.places.splice(0, own.places.length - MOST);
        points.push(...own.places.map((place) => place.clone()));
      }
      if (scene.object) points.push(scene.object.position.clone());
    }
    this.target = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3());
    this.points = points.map((point) => point.sub(this.target));
    const seen = new THREE.Box2();
    let half = 0.03;
    for (const scene of this.scenes) {
      for (const own of scene.arms) {
        if (!own.known) continue;
        seen.union(own.ways);
        half = Math.max(half, 0.5 * own.span);
      }
    }
    const middle = seen.isEmpty() ? new THREE.Vector2() : seen.getCenter(new THREE.Vector2());
    const room = seen.isEmpty() ? new THREE.Vector2() : seen.getSize(new THREE.Vector2());
    this.grasps = { span: 1.25 * half + 0.5 * Math.max(room.x, room.y), x: middle.x, y: middle.y };
    if (!keep) this.facing = this.across();
  }

  across() { // the side from which the path is seen at its full length, and not from behind the arm
    const points = this.scenes.flatMap((scene) => scene.arms.flatMap((own) => own.walked.points));
    if (points.length < 2) return 0;
    const base = this.scenes[0].arms[0].robot.root.position, first = points[0];
    const far = points.reduce((best, point) => (point.distanceTo(first) > best.distanceTo(first) ? point : best), first);
    const out = Math.atan2(far.y + first.y - 2 * base.y, far.x + first.x - 2 * base.x);
    if (Math.hypot(far.x - first.x, far.y - first.y) < 0.05) return out;
    const beside = Math.atan2(far.y - first.y, far.x - first.x) + Math.PI / 2;
    return Math.cos(beside - out) >= 0 ? beside : beside + Math.PI;
  }

  draw() {
    this.scenes.forEach((scene, i) => {
      this.drawArm(scene, this.canvases[i].arm);
      scene.arms.forEach((own, k) => this.drawGrasp(scene, own, this.canvases[i].grasp[k]));
    });
    this.renderer.done();
  }

  drawArm(scene, canvas) {
    const { azimuth, height, zoom } = this.view;
    const aspect = Math.max(0.1, canvas.clientWidth / Math.max(1, canvas.clientHeight));
    const angle = this.facing + azimuth;
    const back = new THREE.Vector3(Math.cos(angle) * Math.cos(height), Math.sin(angle) * Math.cos(height), Math.sin(height));
    this.camera.aspect = aspect;
    this.camera.position.copy(back).multiplyScalar(this.distance(back, angle, aspect) / zoom).add(this.target);
    this.camera.lookAt(this.target);
    this.camera.updateProjectionMatrix();
    this.renderer.draw(canvas, scene.scene, this.camera);
  }

  distance(back, angle, aspect) { // from which every point is inside the picture
    const right = new THREE.Vector3(-Math.sin(angle), Math.cos(angle), 0), up = back.clone().cross(right);
    const high = Math.tan((this.camera.fov * Math.PI) / 360), wide = high * aspect;
    return this.points.reduce((most, point) => {
      const beside = (Math.abs(point.dot(right)) + ROOM) / wide, above = (Math.abs(point.dot(up)) + ROOM) / high;
      return Math.max(most, point.dot(back) + Math.max(beside, above));
    }, 0.5);
  }

  drawGrasp(scene, own, canvas) {
    if (!canvas.clientWidth) return;
    const aspect = canvas.clientWidth / Math.max(1, canvas.clientHeight);
    const { span, x, y } = this.grasps;
    const [w, h] = aspect > 1 ? [span * aspect, span] : [span, span / aspect];
    Object.assign(this.close, { left: -w, right: w, top: h, bottom: -h });
    this.close.updateProjectionMatrix();
    // Pad frame: x approach, z normal. Seen against the normal that points up, approach upwards in the picture.
    const up = own.up ?? 1;
    const local = new THREE.Matrix4().makeBasis(new THREE.Vector3(0, -up, 0), new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 0, up));
    local.setPosition(x, y, 0.3 * up);
    this.close.matrix.multiplyMatrices(own.robot.tip.matrixWorld, local);
    this.close.matrixWorldNeedsUpdate = true;
    for (const one of scene.arms) if (one.outline) one.outline.visible = one.trace.mesh.visible = one === own;
    const drawn = this.renderer.draw(canvas, scene.scene, this.close);
    if (drawn) this.scale(drawn, drawn.width / (2 * w));
  }

  scale({ pen, height, ratio }, pixels) { // a bar of 20 mm
    const length = 0.02 * pixels, x = 10 * ratio, y = height - 10 * ratio;
    pen.strokeStyle = pen.fillStyle = colour("ink");
    pen.lineWidth = 2 * ratio;
    pen.beginPath();
    pen.moveTo(x, y - 4 * ratio); pen.lineTo(x, y); pen.lineTo(x + length, y); pen.lineTo(x + length, y - 4 * ratio);
    pen.stroke();
    pen.font = `${11 * ratio}px system-ui, sans-serif`;
    pen.fillText("20 mm", x + length + 6 * ratio, y + ratio);
  }

  reset() {
    Object.assign(this.view, START);
    this.redraw();
  }

  turnable(canvas) {
    const fingers = new Map();
    let spread = 0;
    const turn = (dx, dy) => {
      this.moved = true;
      this.view.azimuth -= 0.008 * dx;
      this.view.height = Math.min(1.5, Math.max(-0.2, this.view.height + 0.008 * dy));
      this.redraw();
    };
    const closer = (factor) => {
      this.view.zoom = Math.min(12, Math.max(0.4, this.view.zoom * factor));
      this.redraw();
    };
    canvas.tabIndex = 0;
    canvas.addEventListener("pointerdown", (event) => { fingers.set(event.pointerId, event); canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      fingers.set(event.pointerId, event);
      if (fingers.size === 1) return turn(event.clientX - before.clientX, event.clientY - before.clientY);
      const [a, b] = [...fingers.values()];
      const apart = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      if (spread) closer(apart / spread);
      spread = apart;
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => { fingers.delete(event.pointerId); spread = 0; });
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return; // the page scrolls
      event.preventDefault();
      closer(Math.exp(-0.002 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, 20], ArrowDown: [0, -20] }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      turn(...step);
    });
  }
}
