// Everything in three dimensions that belongs to one robot: itself, its plan, its way.

import { Color, LineBasicMaterial, Mesh, MeshBasicMaterial, PointsMaterial, RingGeometry, Scene } from "three";
import { FloorLine } from "./lines";
import { Robot, toScene } from "./robot";
import type { RobotPicture, Shape, Theme } from "./view";

export class Actor {
  readonly robot: Robot;
  readonly ghost: Robot;
  readonly trail: FloorLine;
  readonly plan: FloorLine;
  readonly reference: FloorLine;
  readonly goal: Mesh;

  constructor(private readonly scene: Scene, shape: Shape, theme: Theme, readonly colour: string) {
    const line = (hex: string, opacity: number) =>
      new LineBasicMaterial({ color: new Color(hex), transparent: true, opacity });
    this.robot = new Robot(shape, theme, colour, false);
    this.ghost = new Robot(shape, theme, colour, true);
    this.trail = new FloorLine(line(colour, 0.75), 0.004);
    this.reference = new FloorLine(line(theme.reference, 0.9), 0.003);
    this.plan = new FloorLine(
      new PointsMaterial({ color: new Color(colour), size: 5, sizeAttenuation: false, transparent: true, opacity: 0.9 }),
      0.006,
    );
    const { ballRadius: r } = shape;
    this.goal = new Mesh(
      new RingGeometry(r * 0.78, r * 0.92, 48),
      new MeshBasicMaterial({ color: new Color(colour), transparent: true, opacity: 0.9 }),
    );
    this.goal.rotation.x = -Math.PI / 2;
    scene.add(...this.objects());
  }

  private objects() {
    return [this.robot.group, this.ghost.group, this.goal, this.trail.object, this.plan.object, this.reference.object];
  }

  draw(picture: RobotPicture): void {
    const { pose, prediction, trail, reference, goal, lane } = picture;
    this.robot.place(pose, lane);
    const end = prediction.at(-1);
    // A ghost that stands where the robot stands would only blur it.
    const apart = end ? Math.hypot(end.x - pose.x, end.y - pose.y) : 0;
    this.ghost.group.visible = end !== undefined && apart > 0.03;
    if (end) this.ghost.place(end, lane);
    const pair = (values: Float32Array) => (i: number) => ({ x: values[2 * i] ?? 0, y: values[2 * i + 1] ?? 0 });
    this.trail.set(trail.length / 2, pair(trail), lane);
    this.reference.set(reference.length / 2, pair(reference), lane);
    this.plan.set(prediction.length, (i) => prediction[i] ?? pose, lane);
    this.goal.position.copy(toScene(goal.x, goal.y + lane, 0.005));
  }

  dispose(): void {
    this.scene.remove(...this.objects());
    this.robot.dispose();
    this.ghost.dispose();
    for (const line of [this.trail, this.plan, this.reference]) line.dispose();
    this.goal.geometry.dispose();
    (this.goal.material as MeshBasicMaterial).dispose();
  }
}
