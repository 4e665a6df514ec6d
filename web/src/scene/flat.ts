// The floor from above and the robot from the side, for browsers without WebGL.

import { PAPER_SHAPE, type FloorPoint, type Picture, type RobotPicture, type Shape, type Theme, type View } from "./view";

/** Shown around the followed point, m. */
const SPAN = 3.2;
/** Numbers keep off the edges, px; those of x stand below the words at the top. */
const EDGE = 30;
const TOP = 100;

export class FlatView implements View {
  readonly kind = "2d";
  readonly element = document.createElement("canvas");
  private readonly context: CanvasRenderingContext2D;
  private shape = PAPER_SHAPE;
  private centre: FloorPoint = { x: 0, y: 0 };
  private scale = 100;
  /** Of the host, px: asked for once, since every question lets the browser lay out the page. */
  private width = 0;
  private height = 0;

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
    [this.width, this.height] = [this.host.clientWidth, this.host.clientHeight];
    this.element.width = this.width * ratio;
    this.element.height = this.height * ratio;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.scale = Math.min(this.width, this.height) / SPAN;
  }

  private toCanvas(x: number, y: number): [number, number] {
    return [
      this.width / 2 + (x - this.centre.x) * this.scale,
      this.height / 2 - (y - this.centre.y) * this.scale,
    ];
  }

  draw(picture: Picture): boolean {
    const [dx, dy] = [picture.follow.x - this.centre.x, picture.follow.y - this.centre.y];
    this.centre.x += dx * 0.06;
    this.centre.y += dy * 0.06;
    // A window without height: there is nothing to draw on.
    if (this.scale === 0) return false;
    const { context, theme } = this;
    context.fillStyle = theme.background;
    context.fillRect(0, 0, this.width, this.height);
    this.drawGrid();
    this.drawScale(picture.robots.length === 1);
    for (const robot of picture.robots) this.drawRobot(robot);
    const isPush = picture.strokeKind === "push";
    this.line(picture.stroke.length, (i) => picture.stroke[i] ?? this.centre, isPush ? theme.ballStripe : theme.ink, isPush ? 4 : 2);
    if (isPush) this.arrowHead(picture.stroke, theme.ballStripe, 14);
    return Math.hypot(dx, dy) * this.scale > 0.5;
  }

  /** Whole multiples of a step that are seen, around a middle, over so many pixels. */
  private multiples(step: number, middle: number, pixels: number): number[] {
    const reach = pixels / 2 / this.scale;
    const first = Math.ceil((middle - reach) / step);
    return Array.from({ length: Math.floor((middle + reach) / step) - first + 1 }, (_, i) => (first + i) * step);
  }

  private drawGrid(): void {
    const { context, centre, width, height } = this;
    for (const [step, colour] of [[0.25, this.theme.grid], [1, this.theme.gridStrong]] as const) {
      context.beginPath();
      for (const x of this.multiples(step, centre.x, width)) {
        const [left] = this.toCanvas(x, 0);
        context.moveTo(left, 0);
        context.lineTo(left, height);
      }
      for (const y of this.multiples(step, centre.y, height)) {
        const [, top] = this.toCanvas(0, y);
        context.moveTo(0, top);
        context.lineTo(width, top);
      }
      context.strokeStyle = colour;
      context.lineWidth = 1;
      context.stroke();
    }
  }

  /** The axes at the origin, and numbers at the edges: at whole metres, or half ones. Of y only where
   *  `withY`: robots side by side stand on lanes, each with its own zero. */
  private drawScale(withY: boolean): void {
    const { centre, width, height, theme } = this;
    const origin = { x: 0, y: 0 };
    for (const [end, name] of [[{ x: 0.45, y: 0 }, "x"], [{ x: 0, y: 0.45 }, "y"]] as const) {
      this.line(2, (i) => (i ? end : origin), theme.reference, 2.5);
      this.arrowHead([origin, end], theme.reference, 9);
      const [left, top] = this.toCanvas(1.15 * end.x, 1.15 * end.y);
      this.text(name, left, top, "center");
    }
    for (const x of this.multiples(0.5, centre.x, width - 2 * EDGE)) {
      this.text(`x = ${x} m`, this.toCanvas(x, 0)[0], TOP, "center");
    }
    if (!withY) return;
    for (const y of this.multiples(0.5, centre.y, height / 2)) this.text(`y = ${y} m`, width - 6, this.toCanvas(0, y)[1], "right");
  }

  private text(words: string, left: number, top: number, align: CanvasTextAlign): void {
    const { context } = this;
    context.font = "11px system-ui, sans-serif";
    context.textAlign = align;
    context.textBaseline = "middle";
    context.fillStyle = this.theme.reference;
    context.fillText(words, left, top);
  }

  /** The head of an arrow at the end of a line, px long. */
  private arrowHead(line: readonly FloorPoint[], colour: string, length: number): void {
    const [from, to] = [line[0], line.at(-1)];
    if (!from || !to) return;
    const [left, top] = this.toCanvas(to.x, to.y);
    const along = Math.atan2(from.y - to.y, to.x - from.x);
    const corner = (turn: number): [number, number] => [left - length * Math.cos(along + turn), top - length * Math.sin(along + turn)];
    const { context } = this;
    context.beginPath();
    context.moveTo(left + 0.3 * length * Math.cos(along), top + 0.3 * length * Math.sin(along));
    context.lineTo(...corner(0.45));
    context.lineTo(...corner(-0.45));
    context.fillStyle = colour;
    context.fill();
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
