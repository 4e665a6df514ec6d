// From the histories of the robots to what a view draws.

import type { App } from "./app";
import type { History } from "./history";
import { poseAt, predictedPoses, type Pose } from "./motion";
import { NOW, ROW } from "./layout";
import { colourOf } from "./robots";
import type { FloorPoint, RobotPicture } from "./scene/view";

/** Lanes of robots side by side, m. */
const LANE = 0.6;
/** How far back the ball's way is drawn, s. */
const TRAIL = 25;
/** Points of a trail. */
const TRAIL_POINTS = 700;

function trailOf(history: History, time: number, radius: number): Float32Array {
  const from = history.indexAt(time - TRAIL);
  const until = history.indexAt(time);
  const stride = Math.max(Math.ceil((until - from) / TRAIL_POINTS), 1);
  const points: number[] = [];
  for (let i = from; i < until; i += stride) {
    points.push(history.at(i, 0, ROW.phi) * radius, history.planes === 2 ? history.at(i, 1, ROW.phi) * radius : 0);
  }
  return Float32Array.from(points);
}

function joined(planes: Float64Array[], radius: number): Float32Array {
  const [x, y] = planes;
  const points = new Float32Array(2 * (x?.length ?? 0));
  for (let i = 0; i < (x?.length ?? 0); i++) {
    points[2 * i] = (x?.[i] ?? 0) * radius;
    points[2 * i + 1] = (y?.[i] ?? 0) * radius;
  }
  return points;
}

/** Where the camera looks: at the middle of the robots that stand at a time, s. Who fell rolls away, and
 *  is left behind; when nobody stands, it looks where it looked last. */
export function followed(histories: Pick<History, "endedAt">[], poses: Pose[], time: number, last: FloorPoint): FloorPoint {
  const standing = poses.filter((pose, i) => time < (histories[i]?.endedAt ?? Infinity) && Number.isFinite(pose.x + pose.y));
  const mean = (value: (pose: Pose) => number) => standing.reduce((sum, pose) => sum + value(pose), 0) / standing.length;
  return standing.length > 0 ? { x: mean(({ x }) => x), y: mean(({ y }) => y) } : last;
}

/** Where a robot is to go now, or had to at a time that is looked back at, s. */
export function goalOf(history: History, past: number | undefined, radius: number): FloorPoint {
  const phi = (plane: number) =>
    past === undefined || past >= history.nowAt(plane, NOW.time)
      ? history.nowAt(plane, NOW.phiReference)
      : history.at(Math.max(history.indexAt(past + 1e-9) - 1, 0), plane, ROW.phiReference);
  return { x: phi(0) * radius, y: history.planes === 2 ? phi(1) * radius : 0 };
}

export class Pictures {
  private trails: Float32Array[] = [];
  private references: Float32Array[] = [];
  private follow: FloorPoint = { x: 0, y: 0 };

  constructor(private readonly app: App) {}

  private get radius(): number {
    return this.app.radius;
  }

  /** Sideways shift of a robot, m. */
  lane(index: number): number {
    return (index - (this.app.histories.length - 1) / 2) * LANE;
  }

  /** Where the robots stand. */
  robots(): FloorPoint[] {
    return this.app.histories.map((history, i) => {
      const { x, y } = poseAt(history, this.app.time(), this.radius);
      return { x, y: y + this.lane(i) };
    });
  }

  /** Where the first robot is to go. */
  firstTarget(): FloorPoint {
    const history = this.app.histories[0];
    return history ? goalOf(history, undefined, this.radius) : { x: 0, y: 0 };
  }

  forget(): void {
    this.trails = [];
    this.follow = { x: 0, y: 0 };
  }

  /** Ways and references, thinned for drawing; not needed in every frame. */
  updateLines(time: number): void {
    this.trails = this.app.histories.map((history) => trailOf(history, time, this.radius));
    this.references = this.app.references.map((planes) => joined(planes, this.radius));
  }

  at(time: number): { robots: RobotPicture[]; follow: FloorPoint } {
    const poses = this.app.histories.map((history) => poseAt(history, time, this.radius));
    const past = this.app.isLookingBack ? time : undefined;
    const robots = this.app.histories.map((history, i) => this.picture(history, poses[i] as Pose, past, i));
    this.follow = followed(this.app.histories, poses, time, this.follow);
    return { robots, follow: this.follow };
  }

  private picture(history: History, pose: Pose, past: number | undefined, i: number): RobotPicture {
    const way = this.trails[i] ?? new Float32Array(0);
    const trail = new Float32Array(way.length + 2);
    trail.set(way);
    trail.set([pose.x, pose.y], way.length);
    return {
      pose,
      // The last plan is for now.
      prediction: history.ending === undefined && past === undefined ? predictedPoses(history, this.radius) : [],
      trail,
      reference: this.references[i] ?? new Float32Array(0),
      goal: goalOf(history, past, this.radius),
      lane: this.lane(i),
      colour: colourOf(this.app.robots[i]),
    };
  }
}
