// Collects what a robot does between two batches.

import type { Simulation } from "./generated/ballbot_web.js";
import { ROW_WIDTH } from "./layout";
import type { RobotBatch } from "./protocol";

export class Recorder {
  private rows: number[] = [];
  private motors: number[] = [];
  private statuses: { from: number; text: string }[] = [];
  private lastStatus = "";

  /** One sample of the control, in all planes. */
  sample(simulation: Simulation): void {
    if (!simulation.step()) return;
    const index = this.rows.length / (ROW_WIDTH * simulation.planes());
    for (const value of simulation.row()) this.rows.push(value);
    for (const value of simulation.motors()) this.motors.push(value);
    const text = simulation.status();
    if (text !== this.lastStatus) {
      this.statuses.push({ from: index, text });
      this.lastStatus = text;
    }
  }

  /** What was collected, and where the robot stands. */
  take(simulation: Simulation): RobotBatch {
    const ending = simulation.ending();
    const batch: RobotBatch = {
      rows: Float64Array.from(this.rows),
      motors: Float64Array.from(this.motors),
      statuses: this.statuses,
      now: simulation.now(),
      prediction: Array.from({ length: simulation.planes() }, (_, plane) =>
        simulation.prediction(plane),
      ),
      activeBounds: Array.from({ length: simulation.planes() }, (_, plane) =>
        simulation.active_bounds(plane),
      ),
      down: simulation.is_down(),
      ...(ending === undefined ? {} : { ending }),
    };
    this.rows = [];
    this.motors = [];
    this.statuses = [];
    return batch;
  }
}
