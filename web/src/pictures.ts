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

/** Where the camera looks: at the middle of the robots that stand. Who fell rolls away, and is left
 *  behind; when nobody stands, it looks where it looked last. */
export function followed(histories: Pick<History, "ending">[], poses: Pose[], last: FloorPoint): FloorPoint {
  const standing = poses.filter((pose, i) => histories[i]?.ending === undefined && Number.isFinite(pose.x + pose.y));
  const mean = (value: (pose: Pose) => number) => standing.reduce((sum, pose) => sum + value(pose), 0) / standing.length;
  return standing.length > 0 ? { x: mean(({ x }) => x), y: mean(({ y }) => y) } : last;
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
    return history ? this.goal(history) : { x: 0, y: 0 };
  }

  private goal(history: History): FloorPoint {
    return { x: history.nowAt(0, NOW.phiReference) * this.radius, y: history.planes === 2 ? history.nowAt(1, NOW.phiReference) * this.radius : 0 };
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
    const robots = this.app.histories.map((history, i) => this.picture(history, poses[i] as Pose, i));
    this.follow = followed(this.app.histories, poses, this.follow);
    return { robots, follow: this.follow };
  }

  private picture(history: History, pose: Pose, i: number): RobotPicture {
    const way = this.trails[i] ?? new Float32Array(0);
    const trail = new Float32Array(way.length + 2);
    trail.set(way);
    trail.set([pose.x, pose.y], way.length);
    return {
      pose,
      // The last plan is for now.
      prediction: history.ending === undefined && !this.app.isLookingBack ? predictedPoses(history, this.radius) : [],
      trail,
      reference: this.references[i] ?? new Float32Array(0),
      goal: this.goal(history),
      lane: this.lane(i),
      colour: colourOf(this.app.robots[i]),
    };
  }
}
