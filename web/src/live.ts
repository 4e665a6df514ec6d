// What a person did during a run, so that a file or a link can hold it.

import type { FloorPoint } from "./scene/view";
import { withValue, type Point, type Reference, type Scenario } from "./scenario";

/** More targets than this in one run are not kept. */
const MOST_EVENTS = 500;
/** How fast a drawn path is followed, m/s. */
const PATH_SPEED = 0.35;

interface TimedTarget extends FloorPoint {
  time_s: number;
}

/** A drawn path with times, from where the robot stands. */
export function timedPath(points: FloorPoint[], from: FloorPoint, now: number): TimedTarget[] {
  let time = now;
  let last = from;
  const timed: TimedTarget[] = [{ ...from, time_s: now }];
  for (const point of points) {
    const way = Math.hypot(point.x - last.x, point.y - last.y);
    if (way < 1e-6) continue;
    time += way / PATH_SPEED;
    timed.push({ ...point, time_s: time });
    last = point;
  }
  return timed;
}

export class Live {
  /** The last order that the robot was given; none while it follows the scenario. */
  order: { kind: "target"; at: FloorPoint } | { kind: "path"; points: TimedTarget[] } | undefined;
  private targets: TimedTarget[] = [];
  private pushes: { time_s: number; x: number; y: number }[] = [];

  target(at: FloorPoint, time_s: number): void {
    this.order = { kind: "target", at };
    // A drag is one target: where it ended.
    if (this.targets.at(-1)?.time_s === time_s) this.targets.pop();
    if (this.targets.length < MOST_EVENTS) this.targets.push({ ...at, time_s });
  }

  path(points: TimedTarget[]): void {
    this.order = { kind: "path", points };
  }

  /** A push: change of the tilt rates, rad/s. */
  push(x: number, y: number, time_s: number): void {
    if (this.pushes.length < MOST_EVENTS) this.pushes.push({ time_s, x, y });
  }

  clear(): void {
    this.order = undefined;
    this.targets = [];
    this.pushes = [];
  }

  /** The set-up with what was done written into it. */
  into(setup: Scenario, planes: number): Scenario {
    let made = setup;
    const { ball_radius_m } = setup.parameters;
    const points = (axis: "x" | "y", timed: TimedTarget[]): Point[] =>
      timed.map((point) => ({ time_s: point.time_s, phi_rad: point[axis] / ball_radius_m }));
    const reference = (axis: "x" | "y"): Reference | undefined => {
      if (this.order?.kind === "path") return { lines: { points: points(axis, this.order.points) } };
      if (this.targets.length === 0) return undefined;
      return { set_points: { points: this.withStart(setup, axis, points(axis, this.targets)) } };
    };
    const x = reference("x");
    const y = reference("y");
    if (x && y) made = { ...made, reference: planes === 2 ? { planes: { x, y } } : x };
    if (this.pushes.length > 0) {
      const world = (made["world"] ?? {}) as { pushes?: unknown[] };
      const rates = this.pushes.flatMap(({ time_s, x: theta_x, y: theta_y }) => [
        { rates: { plane: "x", time_s, theta_dot_rad_s: theta_x } },
        ...(planes === 2 ? [{ rates: { plane: "y", time_s, theta_dot_rad_s: theta_y } }] : []),
      ]);
      made = withValue(made, "world.pushes", [...(world.pushes ?? []), ...rates]);
    }
    return made;
  }

  /** The set points of the scenario until the first order, then the orders. */
  private withStart(setup: Scenario, axis: "x" | "y", orders: Point[]): Point[] {
    const { reference } = setup as { reference: { set_points?: { points: Point[] }; planes?: { x: Reference; y: Reference } } };
    const own = (reference.planes?.[axis] ?? (axis === "x" ? reference : {})) as { set_points?: { points: Point[] } };
    const first = orders[0]?.time_s ?? 0;
    const before = (own.set_points?.points ?? [{ time_s: 0, phi_rad: 0 }]).filter(({ time_s }) => time_s < first);
    return [...before, ...orders];
  }
}
