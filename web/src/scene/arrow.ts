// An arrow with a body: a push, or an axis.

import { ConeGeometry, CylinderGeometry, Group, Mesh, MeshBasicMaterial, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);
/** Length and radius of the head, in radii of the shaft. */
const HEAD = 7;
const HEAD_RADIUS = 3;

export class Arrow {
  readonly group = new Group();
  private readonly material = new MeshBasicMaterial();
  private readonly shaft: Mesh;
  private readonly head: Mesh;

  /** `radius` is that of the shaft, m; `inFront`: nothing hides it. */
  constructor(private readonly radius: number, inFront: boolean) {
    this.material.depthTest = !inFront;
    this.material.transparent = inFront;
    this.shaft = new Mesh(new CylinderGeometry(radius, radius, 1, 12), this.material);
    this.head = new Mesh(new ConeGeometry(HEAD_RADIUS * radius, HEAD * radius, 20), this.material);
    this.group.add(this.shaft, this.head);
    this.group.visible = false;
  }

  setColour(colour: string): void {
    this.material.color.set(colour);
  }

  /** Lets it lead from one point of the scene to another; a point is no arrow. */
  set(from: Vector3, to: Vector3): void {
    const way = to.clone().sub(from);
    const length = way.length();
    this.group.visible = length > 1e-3;
    if (!this.group.visible) return;
    const head = Math.min(HEAD * this.radius, length);
    this.group.position.copy(from);
    this.group.quaternion.setFromUnitVectors(UP, way.divideScalar(length));
    this.shaft.scale.y = Math.max(length - head, 1e-3);
    this.shaft.position.y = (length - head) / 2;
    this.head.scale.y = head / (HEAD * this.radius);
    this.head.position.y = length - head / 2;
  }
}
