// Mouse, touch and pen on the floor.

import type { FloorPoint, View } from "./view";

export type Tool = "target" | "path" | "push" | "camera";

export interface Actions {
  target(point: FloorPoint): void;
  path(points: FloorPoint[]): void;
  /** The way that the pointer went with the button down, m. */
  push(by: FloorPoint): void;
  /** Where the robots stand. */
  robots(): FloorPoint[];
}

/** Points closer together than this are one, m. */
const SPACING = 0.02;
/** A press this close to a robot grabs it, pixels. */
const GRAB = 46;
/** Heights at which a robot can be grabbed, m. */
const HEIGHTS = [0.1, 0.3, 0.5, 0.7];
/** A finger that moves less than this has not moved, pixels: a second one may follow for the camera. */
const STILL = 8;

interface Active {
  id: number;
  tool: Tool;
  /** Where the press was, pixels: the camera may go on. */
  pressed: { clientX: number; clientY: number };
  /** Height of the plane in which the pointer moves, m: a body is dragged where it was grabbed. */
  height: number;
  /** The robot that was grabbed, by its place among the robots. */
  robot: number | undefined;
  /** A finger that has not moved yet. */
  waits: boolean;
}

export class Pointer {
  tool: Tool = "target";
  stroke: FloorPoint[] = [];
  strokeKind: "path" | "push" = "path";
  private active: Active | undefined;

  /** Above the floor, m: a body is pushed where it was grabbed. */
  get strokeHeight(): number {
    return this.active?.height ?? 0;
  }

  constructor(private readonly view: View, private readonly actions: Actions) {
    const { element } = view;
    element.addEventListener("pointerdown", (event) => this.down(event));
    element.addEventListener("pointermove", (event) => this.move(event));
    element.addEventListener("pointerup", (event) => this.up(event));
    element.addEventListener("pointercancel", () => this.cancel());
    element.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  private down(event: PointerEvent): void {
    if (this.active) return this.cancel();
    if (event.button !== 0 || this.tool === "camera") return;
    const { pointerId: id, clientX, clientY } = event;
    const grabbed = this.grabbed(event);
    const height = grabbed?.height ?? 0;
    const from = this.view.floorAt(clientX, clientY, height);
    if (!from) return;
    const tool = grabbed ? "push" : this.tool;
    const waits = event.pointerType === "touch";
    this.active = { id, tool, pressed: { clientX, clientY }, height, robot: grabbed?.robot, waits };
    this.view.element.setPointerCapture(id);
    this.strokeKind = tool === "push" ? "push" : "path";
    if (tool === "path") this.stroke = [from];
    if (tool === "target" && !waits) this.actions.target(from);
  }

  /** The robot under the pointer, and the height at which. */
  private grabbed({ clientX, clientY }: PointerEvent): { robot: number; height: number } | undefined {
    const robots = this.actions.robots();
    const places = robots.flatMap(({ x, y }, robot) => HEIGHTS.map((height) => ({ x, y, robot, height })));
    const distances = places.map(({ x, y, height }) => {
      const place = this.view.project(x, y, height);
      return Math.hypot(place.clientX - clientX, place.clientY - clientY);
    });
    const nearest = Math.min(...distances);
    return nearest < GRAB ? places[distances.indexOf(nearest)] : undefined;
  }

  private move(event: PointerEvent): void {
    const { active } = this;
    if (!active || event.pointerId !== active.id) return;
    const { clientX, clientY } = active.pressed;
    if (active.waits && Math.hypot(event.clientX - clientX, event.clientY - clientY) < STILL) return;
    active.waits = false;
    const point = this.view.floorAt(event.clientX, event.clientY, active.height);
    if (!point) return;
    if (active.tool === "target") this.actions.target(point);
    else if (active.tool === "push") {
      const from = this.view.floorAt(clientX, clientY, active.height);
      const foot = this.actions.robots()[active.robot ?? -1] ?? from;
      if (from && foot) this.stroke = [foot, { x: foot.x + point.x - from.x, y: foot.y + point.y - from.y }];
    } else {
      const last = this.stroke.at(-1);
      if (!last || Math.hypot(point.x - last.x, point.y - last.y) > SPACING) this.stroke.push(point);
    }
  }

  private up(event: PointerEvent): void {
    const { active, stroke } = this;
    if (!active || event.pointerId !== active.id) return;
    this.cancel();
    const [start, end] = [stroke[0], stroke.at(-1)];
    if (active.tool === "target" && active.waits) {
      const point = this.view.floorAt(event.clientX, event.clientY);
      if (point) this.actions.target(point);
    }
    if (stroke.length < 2 || !start || !end) return;
    if (active.tool === "path") this.actions.path(stroke);
    if (active.tool === "push") this.actions.push({ x: end.x - start.x, y: end.y - start.y });
  }

  private cancel(): void {
    this.active = undefined;
    this.stroke = [];
  }
}
