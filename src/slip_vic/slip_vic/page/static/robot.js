// An arm from its URDF: nested groups, one per link; joints turn or shift them.

class Robot {
  constructor(arm) {
    this.root = new THREE.Group();
    this.links = arm.links.map(() => new THREE.Group());
    this.meshes = [];
    this.moving = [];
    arm.links.forEach((link, i) => {
      const group = this.links[i];
      group.name = link.name;
      group.position.fromArray(link.position);
      group.quaternion.fromArray(link.quaternion);
      (link.parent < 0 ? this.root : this.links[link.parent]).add(group);
      for (const shape of link.shapes) group.add(this.mesh(shape));
      const place = link.joint ? arm.joints.indexOf(link.joint) : -1;
      if (place >= 0) {
        const axis = new THREE.Vector3().fromArray(link.axis).normalize();
        this.moving.push({ group, place, axis, slides: link.kind === "prismatic", p: group.position.clone(), q: group.quaternion.clone() });
      }
    });
    this.tip = this.links[Math.max(0, arm.links.findIndex((link) => link.name === arm.tip))];
    this.hand = this.handOf(arm);
    this.turn = new THREE.Quaternion();
  }

  mesh(shape) {
    const geometry = geometryOf(shape);
    const [r, g, b, a] = shape.colour;
    const material = new THREE.MeshLambertMaterial({ color: new THREE.Color(r, g, b), transparent: a < 1, opacity: a });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.position.fromArray(shape.position);
    mesh.quaternion.fromArray(shape.quaternion);
    this.meshes.push(mesh);
    return mesh;
  }

  handOf(arm) { // the links that are rigid with the tip: what the grasp camera shows as outlines
    let base = arm.links.findIndex((link) => link.name === arm.tip);
    while (base > 0 && !arm.links[base].joint) base = arm.links[base].parent;
    const rigid = new Set([base]);
    arm.links.forEach((link, i) => { if (rigid.has(link.parent) && !link.joint) rigid.add(i); });
    rigid.delete(base);
    return [...rigid].map((i) => this.links[i]);
  }

  pose(q, start) {
    for (const joint of this.moving) {
      const value = q[start + joint.place];
      if (!Number.isFinite(value)) continue;
      if (joint.slides) {
        joint.group.position.copy(joint.axis).multiplyScalar(value).applyQuaternion(joint.q).add(joint.p);
      } else {
        joint.group.quaternion.copy(joint.q).multiply(this.turn.setFromAxisAngle(joint.axis, value));
      }
    }
    this.root.updateMatrixWorld(true);
  }
}

function geometryOf(shape) {
  const size = shape.size;
  if (shape.kind === "box") return new THREE.BoxGeometry(...size);
  if (shape.kind === "sphere") return new THREE.SphereGeometry(size[0], 24, 16);
  if (shape.kind === "cylinder") return new THREE.CylinderGeometry(size[0], size[0], size[1], 32).rotateX(Math.PI / 2);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(shape.points, 3));
  geometry.setIndex(new THREE.BufferAttribute(shape.faces, 1));
  geometry.scale(...size);
  geometry.computeVertexNormals();
  return geometry;
}
