// Where the robot is between two samples, for the eye: angles and rates are known at both ends
// of a sample, a cubic joins them. The computed run is not touched.

import type { History } from "./history";
import { NOW, NOW_WIDTH, ROW } from "./layout";

/** A robot on the floor: ball in m, lean of the body towards +x and +y in rad. */
export interface Pose {
  x: number;
  y: number;
  leanX: number;
  leanY: number;
}

function hermite(s: number, h: number, a: number, da: number, b: number, db: number): number {
  const s2 = s * s;
  const s3 = s2 * s;
  return (
    (2 * s3 - 3 * s2 + 1) * a + (s3 - 2 * s2 + s) * h * da + (3 * s2 - 2 * s3) * b + (s3 - s2) * h * db
  );
}

/** Angles (phi, theta) of a plane at a time. */
function anglesAt(history: History, plane: number, time: number): [number, number] {
  const end = history.nowAt(plane, NOW.time);
  const after = history.indexAt(time);
  if (history.length === 0 || time >= end) {
    return [history.nowAt(plane, NOW.phi), history.nowAt(plane, NOW.theta)];
  }
  const from = Math.max(after - 1, 0);
  const start = (column: number) => history.at(from, plane, column);
  const last = from + 1 >= history.length;
  const stop = (column: number) =>
    last ? (history.now[plane * NOW_WIDTH + column] ?? 0) : history.at(from + 1, plane, column);
  const h = stop(ROW.time) - start(ROW.time);
  const s = h > 0 ? Math.min(Math.max((time - start(ROW.time)) / h, 0), 1) : 1;
  const angle = (position: number, rate: number) =>
    hermite(s, h, start(position), start(rate), stop(position), stop(rate));
  return [angle(ROW.phi, ROW.phiDot), angle(ROW.theta, ROW.thetaDot)];
}

/** In the paper's signs a move towards +x begins with a lean to negative theta: the body leans
 *  towards +x where theta is negative. */
export function poseOf(angles: [number, number][], ballRadius: number): Pose {
  const [x, y] = angles;
  return {
    x: (x?.[0] ?? 0) * ballRadius,
    y: (y?.[0] ?? 0) * ballRadius,
    leanX: -(x?.[1] ?? 0),
    leanY: -(y?.[1] ?? 0),
  };
}

export function poseAt(history: History, time: number, ballRadius: number): Pose {
  const planes = Array.from({ length: history.planes }, (_, plane) => anglesAt(history, plane, time));
  return poseOf(planes, ballRadius);
}

/** No plan leads further than this from where the robot stands, m. */
const FARTHEST = 50;

/** The poses of the last plan, up to the first that is no place near the robot: a controller that finds
 *  no way out may plan anything. */
export function predictedPoses(history: History, ballRadius: number): Pose[] {
  const [x, y] = history.predictions;
  const here = poseOf([[history.nowAt(0, NOW.phi), 0], [history.nowAt(1, NOW.phi), 0]], ballRadius);
  const poses: Pose[] = [];
  for (let i = 0; 4 * i < (x?.length ?? 0); i++) {
    const angles = (states: Float64Array | undefined): [number, number] => [
      states?.[4 * i] ?? 0,
      states?.[4 * i + 1] ?? 0,
    ];
    const pose = poseOf([angles(x), angles(y)], ballRadius);
    const near = Math.hypot(pose.x - here.x, pose.y - here.y) < FARTHEST && Number.isFinite(pose.leanX + pose.leanY);
    if (!near) break;
    poses.push(pose);
  }
  return poses;
}
