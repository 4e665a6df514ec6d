// What a person did during a run, so that a file or a link can hold it.

import type { FloorPoint } from "./scene/view";
import { withValue, type Point, type Reference, type Scenario } from "./scenario";

/** So many targets of one run are kept: the first ones, and the last. So many pushes, too: the first. */
const MOST_EVENTS = 500;
/** A step takes this long where it stands among lines, s. */
const STEP = 1e-6;
/** How fast a drawn path is followed, m/s. */
const PATH_SPEED = 0.35;

interface TimedTarget extends FloorPoint {
  time_s: number;
}

/** A drawn path with times, from where the robot stands now. */
export function timedPath(points: FloorPoint[], from: FloorPoint): TimedTarget[] {
  let time = 0;
  let last = from;
  const timed: TimedTarget[] = [{ ...from, time_s: 0 }];
  for (const point of points) {
    const way = Math.hypot(point.x - last.x, point.y - last.y);
    if (way < 1e-6) continue;
    time += way / PATH_SPEED;
    timed.push({ ...point, time_s: time });
    last = point;
  }
  return timed;
}

/** A target is a point, a drawn path are several; each holds until the next one. */
type Order = { time_s: number; place: number }[];
type Axis = "x" | "y";
const AXES: Axis[] = ["x", "y"];

/** What of a set-up's own reference goes into the file: set points and lines. */
interface Own {
  set_points?: { points: Point[] };
  lines?: { points: Point[] };
}

export class Live {
  private orders: Record<Axis, Order[]> = { x: [], y: [] };
  /** The last of the scenario's set points whose smooth moves had not begun at the first order. */
  private waiting: Record<Axis, number> = { x: 0, y: 0 };
  private pushes: { time_s: number; x: number; y: number }[] = [];

  /** `dropped`, per plane: moves before this one that had not begun. */
  target(at: FloorPoint, time_s: number, dropped: number[]): void {
    for (const [plane, axis] of AXES.entries()) {
      const orders = this.orders[axis];
      const moves = dropped[plane] ?? 0;
      if (orders.length === 0) this.waiting[axis] = moves;
      // A drag is one target: where it ended.
      else if (moves > 0 || orders.at(-1)?.[0]?.time_s === time_s || orders.length >= MOST_EVENTS) orders.pop();
      orders.push([{ time_s, place: at[axis] }]);
    }
  }

  path(points: TimedTarget[]): void {
    for (const axis of AXES) this.orders[axis].push(points.map((point) => ({ time_s: point.time_s, place: point[axis] })));
  }

  /** A push: change of the tilt rates, rad/s. */
  push(x: number, y: number, time_s: number): void {
    if (this.pushes.length < MOST_EVENTS) this.pushes.push({ time_s, x, y });
  }

  clear(): void {
    this.orders = { x: [], y: [] };
    this.waiting = { x: 0, y: 0 };
    this.pushes = [];
  }

  /** The set-up with what was done written into it. */
  into(setup: Scenario, planes: number): Scenario {
    let made = setup;
    if (this.orders.x.length > 0) {
      const [x, y] = [this.reference(setup, "x"), this.reference(setup, "y")];
      made = { ...made, reference: planes === 2 ? { planes: { x, y } } : x };
    }
    if (this.pushes.length > 0) {
      const world = (made["world"] ?? {}) as { pushes?: unknown[] };
      const rates = this.pushes.flatMap(({ time_s, x: theta_x, y: theta_y }) => [
        { rates: { plane: "x", time_s, theta_dot_rad_s: theta_x } },
        ...(planes === 2 ? [{ rates: { plane: "y", time_s, theta_dot_rad_s: theta_y } }] : []),
      ]);
      // A world that is there for the pushes alone is still ideal: without a plan the run ends.
      if (made["world"] === undefined) made = withValue(made, "world.without_plan", "end");
      made = withValue(made, "world.pushes", [...(world.pushes ?? []), ...rates]);
    }
    return made;
  }

  /** The scenario's set points or lines until the first order, then the orders. */
  private reference(setup: Scenario, axis: Axis): Reference {
    const { ball_radius_m } = setup.parameters;
    const orders = this.orders[axis].map((order) =>
      order.map(({ time_s, place }): Point => ({ time_s, phi_rad: place / ball_radius_m })));
    const { reference } = setup as { reference: Own & { planes?: { x: Own; y: Own } } };
    const own = reference.planes?.[axis] ?? (axis === "x" ? reference : {});
    const first = orders[0]?.[0]?.time_s ?? 0;
    const points = (own.lines ?? own.set_points)?.points ?? [{ time_s: 0, phi_rad: 0 }];
    const reached = points.slice(0, points.length - this.waiting[axis]).filter(({ time_s }) => time_s < first);
    // The line that is under way at the first order is followed up to there.
    const before = own.lines && reached.length > 0 ? [points.slice(0, reached.length + 1)] : reached.map((point) => [point]);
    // Where it was before all points is where the first move begins.
    const start = points[0];
    if (before.length === 0 && start && (first > 0 || setup.controller["shaping"])) before.push([{ ...start, time_s: first - STEP }]);
    const all = [...before, ...orders];
    return all.every(({ length }) => length === 1) ? { set_points: { points: all.flat() } } : { lines: { points: joined(all) } };
  }
}

/** Points and lines one after the other, as lines: each holds until the next one begins. */
function joined(orders: Point[][]): Point[] {
  let made: Point[] = [];
  for (const order of orders) {
    const begin = order[0]?.time_s ?? 0;
    const end = begin - STEP;
    const held = between(made, end);
    made = made.filter(({ time_s }) => time_s < end);
    if (held !== undefined) made.push({ time_s: end, phi_rad: held });
    made.push(...order);
  }
  return made;
}

/** The value of lines between points at a time; `undefined` before the first one. */
function between(points: Point[], time: number): number | undefined {
  const next = points.findIndex(({ time_s }) => time_s > time);
  const [from, to] = [points.at(next < 0 ? -1 : next - 1), points[next]];
  if (next === 0 || from === undefined) return undefined;
  if (to === undefined) return from.phi_rad;
  return from.phi_rad + ((to.phi_rad - from.phi_rad) * (time - from.time_s)) / (to.time_s - from.time_s);
}
