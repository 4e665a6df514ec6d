// The floor from above and the robot from the side, for browsers without WebGL.

import type { FloorPoint, Picture, RobotPicture, Shape, Theme, View } from "./view";

/** Shown around the followed point, m. */
const SPAN = 3.2;

export class FlatView implements View {
  readonly kind = "2d";
  readonly element = document.createElement("canvas");
  private readonly context: CanvasRenderingContext2D;
  private shape: Shape = { ballRadius: 0.12, wheelRadius: 0.05, zenith: Math.PI / 4, centreOfMass: 0.3 };
  private centre: FloorPoint = { x: 0, y: 0 };
  private scale = 100;

  constructor(private readonly host: HTMLElement, private theme: Theme) {
    host.append(this.element);
    const context = this.element.getContext("2d");
    if (!context) throw new Error("this browser has no canvas");
    this.context = context;
    this.resize();
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
  }

  setShape(shape: Shape): void {
    this.shape = shape;
  }

  setCameraTool(): void {}

  resize(): void {
    const ratio = Math.min(window.devicePixelRatio, 2);
    this.element.width = this.host.clientWidth * ratio;
    this.element.height = this.host.clientHeight * ratio;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.scale = Math.min(this.host.clientWidth, this.host.clientHeight) / SPAN;
  }

  private toCanvas(x: number, y: number): [number, number] {
    return [
      this.host.clientWidth / 2 + (x - this.centre.x) * this.scale,
      this.host.clientHeight / 2 - (y - this.centre.y) * this.scale,
    ];
  }

  draw(picture: Picture): boolean {
    const [dx, dy] = [picture.follow.x - this.centre.x, picture.follow.y - this.centre.y];
    this.centre.x += dx * 0.06;
    this.centre.y += dy * 0.06;
    const { context, theme } = this;
    context.fillStyle = theme.background;
    context.fillRect(0, 0, this.host.clientWidth, this.host.clientHeight);
    this.drawGrid();
    for (const robot of picture.robots) this.drawRobot(robot);
    this.line(picture.stroke.length, (i) => picture.stroke[i] ?? this.centre, theme.ink, 2);
    return Math.hypot(dx, dy) * this.scale > 0.5;
  }

  private drawGrid(): void {
    for (const [step, colour] of [[0.25, this.theme.grid], [1, this.theme.gridStrong]] as const) {
      const reach = 20;
      for (let at = -reach; at <= reach; at += step) {
        const x = Math.round(this.centre.x) + at;
        const y = Math.round(this.centre.y) + at;
        this.line(2, (i) => ({ x, y: this.centre.y + (i ? reach : -reach) }), colour, 1);
        this.line(2, (i) => ({ x: this.centre.x + (i ? reach : -reach), y }), colour, 1);
      }
    }
  }

  private line(count: number, point: (i: number) => FloorPoint, colour: string, width: number): void {
    if (count < 2) return;
    const { context } = this;
    context.beginPath();
    for (let i = 0; i < count; i++) {
      const { x, y } = point(i);
      context.lineTo(...this.toCanvas(x, y));
    }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }

  private disc(x: number, y: number, radius: number, fill: string | undefined, stroke: string, width: number): void {
    const { context } = this;
    context.beginPath();
    context.arc(...this.toCanvas(x, y), radius * this.scale, 0, 2 * Math.PI);
    if (fill !== undefined) {
      context.fillStyle = fill;
      context.fill();
    }
    context.strokeStyle = stroke;
    context.lineWidth = width;
    context.stroke();
  }

  private drawRobot({ pose, prediction, trail, reference, goal, lane, colour }: RobotPicture): void {
    const r = this.shape.ballRadius;
    const pair = (values: Float32Array) => (i: number) => ({ x: values[2 * i] ?? 0, y: (values[2 * i + 1] ?? 0) + lane });
    this.line(reference.length / 2, pair(reference), this.theme.reference, 1);
    this.line(trail.length / 2, pair(trail), colour, 1.5);
    for (const { x, y } of prediction) this.disc(x, y + lane, 0.008, colour, colour, 1);
    this.disc(goal.x, goal.y + lane, 0.85 * r, undefined, colour, 2);
    this.disc(pose.x, pose.y + lane, r, this.theme.ball, this.theme.ink, 1);
    // The body as seen from above: its top is off the ball's centre by the lean.
    const height = 2 * this.shape.centreOfMass;
    const top = {
      x: pose.x + height * Math.sin(pose.leanX),
      y: pose.y + lane + height * Math.sin(pose.leanY),
    };
    this.line(2, (i) => (i ? top : { x: pose.x, y: pose.y + lane }), this.theme.body, 6);
    this.disc(top.x, top.y, 0.55 * r, colour, this.theme.ink, 1);
  }

  floorAt(clientX: number, clientY: number): FloorPoint {
    const box = this.element.getBoundingClientRect();
    return {
      x: this.centre.x + (clientX - box.left - box.width / 2) / this.scale,
      y: this.centre.y - (clientY - box.top - box.height / 2) / this.scale,
    };
  }

  project(x: number, y: number): { clientX: number; clientY: number } {
    const box = this.element.getBoundingClientRect();
    const [left, top] = this.toCanvas(x, y);
    return { clientX: box.left + left, clientY: box.top + top };
  }
}
