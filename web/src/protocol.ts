// What page and worker say to each other.

import type { Scenario } from "./scenario";

/** One robot of a run. */
export interface RobotSetup {
  label: string;
  setup: Scenario;
}

/** A push on the body in one instant: change of the tilt's rate in each plane, rad/s. */
export interface Push {
  x: number;
  y: number;
}

/** Phi in both planes, rad. */
export interface PhiPair {
  x: number;
  y: number;
}

/** Calls that are answered with a value or an error. */
export type Call =
  | { kind: "parse"; toml: string }
  /** `keep`: a run that has begun goes on with the new set-up. */
  | { kind: "configure"; robots: RobotSetup[]; keep: boolean }
  | { kind: "step" }
  | { kind: "target"; phi: PhiPair }
  /** Times from when the worker takes it. */
  | { kind: "path"; points: { time_s: number; phi: PhiPair }[] }
  | { kind: "push"; push: Push };

/** What comes back from each call. */
export interface Answers {
  parse: Scenario;
  configure: {
    robots: RobotFacts[];
    /** The run goes on; otherwise it begins anew. */
    kept: boolean;
  };
  step: null;
  target: Taken & {
    /** Per plane: smooth moves that had not begun and are dropped for this one; at the first target those
     *  of the scenario's own set points. */
    dropped: number[];
  };
  path: Taken;
  push: Taken;
}

/** When an order takes effect: the robots may be further than what the page has seen of them. */
export interface Taken {
  /** Simulated time, s. */
  time_s: number;
}

/** What holds for a robot during a run. */
export interface RobotFacts {
  label: string;
  /** No set-up has a target further away, rad. */
  most_ball_angle: number;
  /** No set-up has a harder push, rad/s. */
  most_tilt_rate: number;
  planes: number;
  sampling_time: number;
  horizon: number;
  samples: number;
  /** Angle of the wheels' contact points from the top of the ball, rad. */
  zenith: number;
  /** Azimuths of the wheels from the robot's x axis, counter-clockwise seen from above, rad. */
  azimuths: number[];
}

/** Run or stop, at so many times real time. */
export interface RunOrder {
  /** Counts the orders: what is said of `running` in batches from before the last one is void. */
  number: number;
  /** Left out: as it is. */
  running?: boolean;
  speed: number;
}

export type ToWorker =
  | { id: number; call: Call }
  | { run: RunOrder }
  /** Whether it still answers. */
  | { ping: true };

/** What happened to one robot since the last batch. */
export interface RobotBatch {
  /** Samples times planes times ROW_WIDTH (layout.ts). */
  rows: Float64Array;
  /** Samples times three, N m. */
  motors: Float64Array;
  /** Status of each sample, in words, run-length coded: the first sample it holds from. */
  statuses: { from: number; text: string }[];
  /** Planes times NOW_WIDTH (layout.ts). */
  now: Float64Array;
  /** Per plane: the bounds that are active in the last plan, in words. */
  activeBounds: string[];
  /** Per plane: the states that the last plan leads through, four per sample. */
  prediction: Float64Array[];
  /** Why it stopped, in words; absent while it runs. */
  ending?: string;
  /** It lies on the floor. */
  down: boolean;
}

export interface Batch {
  /** Simulated time that the display has reached, s. */
  clock: number;
  running: boolean;
  /** Number of the last order to run or stop. */
  order: number;
  /** Set at the first batch of a run: what was shown before is void. */
  restarted: boolean;
  /** The run has reached the end of its scenario. */
  complete: boolean;
  robots: RobotBatch[];
  /** Per robot, per plane: phi_ref along its way, for the floor. Sent when it changed. */
  references?: Float64Array[][];
}

export type FromWorker =
  | { pong: true }
  | { id: number; value: unknown }
  | { id: number; error: string }
  | { batch: Batch }
  /** The control loop has ended for good. */
  | { failed: string };
