// Mouse, touch and pen on the floor.

import type { FloorPoint, View } from "./view";

export type Tool = "target" | "path" | "push" | "camera";

export interface Actions {
  target(point: FloorPoint): void;
  path(points: FloorPoint[]): void;
  /** From the point that was grabbed to the point of release, m on the floor. */
  push(by: FloorPoint): void;
  /** Where the first robot stands. */
  robot(): FloorPoint;
}

/** Points closer together than this are one, m. */
const SPACING = 0.02;
/** A press this close to the robot grabs it, pixels. */
const GRAB = 46;

export class Pointer {
  tool: Tool = "target";
  stroke: FloorPoint[] = [];
  strokeKind: "path" | "push" = "path";
  private active: { id: number; tool: Tool; start: FloorPoint } | undefined;

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
    const point = this.view.floorAt(event.clientX, event.clientY);
    if (!point) return;
    const tool = this.grabs(event) ? "push" : this.tool;
    const start = tool === "push" ? this.actions.robot() : point;
    this.active = { id: event.pointerId, tool, start };
    this.view.element.setPointerCapture(event.pointerId);
    this.strokeKind = tool === "push" ? "push" : "path";
    if (tool === "target") this.actions.target(point);
    else this.stroke = [start];
  }

  /** Whether the press is on the robot's body. */
  private grabs(event: PointerEvent): boolean {
    const { x, y } = this.actions.robot();
    const heights = [0.1, 0.3, 0.5, 0.7];
    return heights.some((height) => {
      const { clientX, clientY } = this.view.project(x, y, height);
      return Math.hypot(clientX - event.clientX, clientY - event.clientY) < GRAB;
    });
  }

  private move(event: PointerEvent): void {
    if (!this.active || event.pointerId !== this.active.id) return;
    const point = this.view.floorAt(event.clientX, event.clientY);
    if (!point) return;
    if (this.active.tool === "target") this.actions.target(point);
    else if (this.active.tool === "push") this.stroke = [this.active.start, point];
    else {
      const last = this.stroke.at(-1);
      if (!last || Math.hypot(point.x - last.x, point.y - last.y) > SPACING) this.stroke.push(point);
    }
  }

  private up(event: PointerEvent): void {
    if (!this.active || event.pointerId !== this.active.id) return;
    const { tool, start } = this.active;
    const points = this.stroke;
    this.cancel();
    const end = points.at(-1);
    if (tool === "path" && points.length > 1) this.actions.path(points);
    if (tool === "push" && end && points.length > 1) {
      this.actions.push({ x: end.x - start.x, y: end.y - start.y });
    }
  }

  private cancel(): void {
    this.active = undefined;
    this.stroke = [];
  }
}
