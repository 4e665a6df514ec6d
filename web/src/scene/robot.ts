// The robot's body in three dimensions: ball, three omniwheels with rollers, slim body.

import {
  CanvasTexture, Color, CylinderGeometry, Group, InstancedMesh, LatheGeometry, Material, Matrix4,
  Mesh, MeshStandardMaterial, Object3D, Quaternion, SphereGeometry, SRGBColorSpace, TorusGeometry,
  Vector2, Vector3,
} from "three";
import type { Pose } from "../motion";
import type { Shape, Theme } from "./view";

const UP = new Vector3(0, 1, 0);
const ROLLERS = 9;

/** The floor's (x, y) in the scene: x to the right, height up, y away from the viewer. */
export function toScene(x: number, y: number, height = 0): Vector3 {
  return new Vector3(x, height, -y);
}

/** The rotation of something that tips or rolls by `angle` towards a direction on the floor. */
function tip(x: number, y: number, target: Quaternion): Quaternion {
  const angle = Math.hypot(x, y);
  if (angle < 1e-9) return target.identity();
  const axis = UP.clone().cross(toScene(x / angle, y / angle));
  return target.setFromAxisAngle(axis, angle);
}

function ballTexture(theme: Theme): CanvasTexture {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1024, 512];
  const context = canvas.getContext("2d");
  if (context) {
    const [w, h] = [canvas.width, canvas.height];
    context.fillStyle = theme.ball;
    context.fillRect(0, 0, w, h);
    context.fillStyle = theme.ballStripe;
    for (let i = 0; i < 8; i++) {
      for (let j = 0; j < 4; j++) {
        if ((i + j) % 2 === 0) context.fillRect((i * w) / 8, (j * h) / 4, w / 8, h / 4);
      }
    }
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 4;
  return texture;
}

export class Robot {
  readonly group = new Group();
  private readonly ball: Mesh;
  private readonly body = new Group();
  private readonly spinning: { object: Object3D; axis: Vector3 }[] = [];
  private readonly geometries: { dispose(): void }[] = [];
  private readonly materials: Material[] = [];
  private last: Pose | undefined;

  constructor(private readonly shape: Shape, theme: Theme, colour: string, ghost: boolean) {
    const material = (hex: string, roughness: number, metalness: number) => {
      const made = new MeshStandardMaterial({ color: new Color(hex), roughness, metalness });
      if (ghost) {
        made.transparent = true;
        made.opacity = 0.16;
        made.depthWrite = false;
        made.color = new Color(colour);
      }
      this.materials.push(made);
      return made;
    };
    const surface = material(theme.ball, 0.45, 0);
    if (!ghost) {
      surface.map = ballTexture(theme);
      surface.color = new Color("#ffffff");
      this.geometries.push(surface.map);
    }
    this.ball = this.mesh(new SphereGeometry(shape.ballRadius, 48, 32), surface);
    this.group.add(this.ball, this.body);
    this.buildBody(material(theme.body, 0.5, 0.1), material(theme.metal, 0.35, 0.6), material(colour, 0.4, 0.1));
    if (!ghost) this.buildWheels(material(theme.metal, 0.4, 0.5), material(theme.body, 0.7, 0));
    this.group.traverse((object) => {
      object.castShadow = !ghost;
      object.receiveShadow = !ghost;
    });
  }

  private mesh(geometry: SphereGeometry | CylinderGeometry | LatheGeometry | TorusGeometry, material: Material): Mesh {
    this.geometries.push(geometry);
    return new Mesh(geometry, material);
  }

  /** Base plate, legs, mast, plates and head: origin at the centre of the ball. */
  private buildBody(body: Material, metal: Material, accent: Material): void {
    const { ballRadius: r, centreOfMass: l } = this.shape;
    const base = r * 1.52;
    const top = base + Math.max(1.75 * l, 2 * r);
    const plate = (y: number, radius: number, thickness: number, material: Material) => {
      const made = this.mesh(new CylinderGeometry(radius, radius, thickness, 48), material);
      made.position.y = y;
      this.body.add(made);
    };
    plate(base, r * 0.98, r * 0.09, body);
    plate(base + (top - base) * 0.42, r * 0.62, r * 0.06, body);
    plate(base + (top - base) * 0.42 + r * 0.05, r * 0.625, r * 0.035, accent);
    plate(top, r * 0.62, r * 0.06, body);
    for (let i = 0; i < 3; i++) {
      const angle = (i * 2 * Math.PI) / 3 + Math.PI / 3;
      const rod = this.mesh(new CylinderGeometry(r * 0.045, r * 0.045, top - base, 12), metal);
      rod.position.set(Math.cos(angle) * r * 0.5, (top + base) / 2, Math.sin(angle) * r * 0.5);
      this.body.add(rod);
    }
    const profile = [[0, 0], [0.42, 0], [0.46, 0.06], [0.46, 0.5], [0.4, 0.62], [0, 0.66]];
    const head = this.mesh(
      new LatheGeometry(profile.map(([x, y]) => new Vector2((x ?? 0) * r, (y ?? 0) * r)), 40),
      body,
    );
    head.position.y = top + r * 0.03;
    const ring = this.mesh(new TorusGeometry(r * 0.465, r * 0.035, 12, 48), accent);
    ring.rotation.x = Math.PI / 2;
    ring.position.y = top + r * 0.34;
    this.body.add(head, ring);
  }

  private buildWheels(metal: Material, rubber: Material): void {
    const { ballRadius: r, wheelRadius, zenith, azimuths } = this.shape;
    for (const azimuth of azimuths) {
      const outward = toScene(Math.cos(azimuth), Math.sin(azimuth));
      const normal = UP.clone().multiplyScalar(Math.cos(zenith)).addScaledVector(outward, Math.sin(zenith));
      const tangent = UP.clone().cross(outward);
      const axle = normal.clone().cross(tangent);
      const wheel = new Group();
      wheel.position.copy(normal).multiplyScalar(r + wheelRadius);
      wheel.quaternion.setFromUnitVectors(UP, axle);
      const spin = new Group();
      const width = wheelRadius * 0.36;
      spin.add(this.mesh(new CylinderGeometry(wheelRadius * 0.72, wheelRadius * 0.72, width, 32), metal));
      const hub = this.mesh(new CylinderGeometry(wheelRadius * 0.2, wheelRadius * 0.2, width * 1.5, 16), rubber);
      spin.add(hub, this.rollers(wheelRadius, rubber));
      wheel.add(spin);
      this.spinning.push({ object: spin, axis: axle });
      // The strut that carries the wheel.
      const motor = this.mesh(new CylinderGeometry(wheelRadius * 0.42, wheelRadius * 0.42, r * 0.55, 20), metal);
      motor.quaternion.setFromUnitVectors(UP, axle);
      motor.position.copy(wheel.position).addScaledVector(axle, Math.sign(axle.y) * r * 0.36);
      this.body.add(wheel, motor);
    }
  }

  /** Two staggered rows of rollers, each free to turn about the rim's tangent. */
  private rollers(wheelRadius: number, material: Material): InstancedMesh {
    const profile = Array.from({ length: 7 }, (_, i) => {
      const along = (i / 6 - 0.5) * wheelRadius * 0.62;
      return new Vector2(Math.sqrt(Math.max(wheelRadius ** 2 - along ** 2, 0)) - wheelRadius * 0.78, along);
    });
    const geometry = new LatheGeometry(profile, 10);
    this.geometries.push(geometry);
    const mesh = new InstancedMesh(geometry, material, 2 * ROLLERS);
    const place = new Matrix4();
    const turn = new Quaternion();
    for (let k = 0; k < 2 * ROLLERS; k++) {
      const row = k % 2;
      const angle = (Math.floor(k / 2) + row / 2) * ((2 * Math.PI) / ROLLERS);
      const radial = new Vector3(Math.cos(angle), 0, Math.sin(angle));
      turn.setFromUnitVectors(UP, new Vector3(-Math.sin(angle), 0, Math.cos(angle)));
      const position = radial.multiplyScalar(wheelRadius * 0.78);
      position.y = (row - 0.5) * wheelRadius * 0.4;
      place.compose(position, turn, new Vector3(1, 1, 1));
      mesh.setMatrixAt(k, place);
    }
    return mesh;
  }

  /** Puts the robot there; the ball rolls and the wheels turn by the way since the last call. */
  place(pose: Pose, lane: number): void {
    const { ballRadius: r, wheelRadius } = this.shape;
    const last = this.last ?? pose;
    this.group.position.copy(toScene(pose.x, pose.y + lane, r));
    tip(pose.leanX, pose.leanY, this.body.quaternion);
    const roll = tip((pose.x - last.x) / r, (pose.y - last.y) / r, new Quaternion());
    this.ball.quaternion.premultiply(roll);
    const rolled = UP.clone().cross(toScene((pose.x - last.x) / r, (pose.y - last.y) / r));
    const tipped = UP.clone().cross(toScene(pose.leanX - last.leanX, pose.leanY - last.leanY));
    const relative = rolled.sub(tipped);
    for (const { object, axis } of this.spinning) {
      object.rotation.y -= (relative.dot(axis) * r) / wheelRadius;
    }
    this.last = { ...pose };
  }

  dispose(): void {
    for (const made of [...this.geometries, ...this.materials]) made.dispose();
  }
}
