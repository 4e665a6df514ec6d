// What one robot did, as far back as it is kept.

import { NOW, NOW_WIDTH, ROW, ROW_WIDTH } from "./layout";
import type { RobotBatch } from "./protocol";

/** Samples that are kept; older ones make room, so that memory does not grow. */
export const CAPACITY = 60_000;
/** Predictions that are kept to be compared with what happened. */
const FAN = 8;

/** The states that a plan leads through, four per sample, from `time` on. The sampling time, s, is that
 *  of then. */
export interface Prediction {
  time: number;
  samplingTime: number;
  states: Float64Array;
}

/** The first of `length` places that is not before what is looked for. */
function bisect(length: number, isBefore: (place: number) => boolean): number {
  let [low, high] = [0, length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (isBefore(middle)) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class History {
  /** Samples in the buffer. */
  length = 0;
  /** Samples ever; those before `total - length` are gone. */
  total = 0;
  now: Float64Array = new Float64Array(NOW_WIDTH * 2);
  predictions: Float64Array[] = [];
  /** Per plane: earlier predictions. */
  fans: Prediction[][] = [];
  /** Per plane: the active bounds of the last plan, in words. */
  activeBounds: string[] = [];
  status = "";
  statusFrom: { sample: number; text: string }[] = [];
  ending: string | undefined;
  /** When it was seen to have stopped, s; absent while it runs. */
  endedAt: number | undefined;
  down = false;
  private readonly width: number;
  private readonly data: Float64Array;
  private readonly motorData: Float64Array;
  private fanNext = 0;

  constructor(
    readonly planes: number,
    public samplingTime: number,
    /** Time between two kept predictions, s. */
    private readonly fanInterval: number,
  ) {
    this.width = planes * ROW_WIDTH;
    this.data = new Float64Array(CAPACITY * this.width);
    this.motorData = new Float64Array(CAPACITY * 3);
    this.fans = Array.from({ length: planes }, () => []);
  }

  add(batch: RobotBatch): void {
    const count = batch.rows.length / this.width;
    for (const { from, text } of batch.statuses) {
      this.statusFrom.push({ sample: this.total + from, text });
      this.status = text;
    }
    if (this.statusFrom.length > CAPACITY) this.statusFrom.splice(0, CAPACITY / 2);
    for (let i = 0; i < count; i++) {
      const place = (this.total + i) % CAPACITY;
      this.data.set(batch.rows.subarray(i * this.width, (i + 1) * this.width), place * this.width);
      this.motorData.set(batch.motors.subarray(i * 3, i * 3 + 3), place * 3);
    }
    this.total += count;
    this.length = Math.min(this.total, CAPACITY);
    this.now = batch.now;
    this.predictions = batch.prediction;
    this.activeBounds = batch.activeBounds;
    this.ending = batch.ending;
    if (batch.ending !== undefined) this.endedAt ??= this.nowAt(0, NOW.time);
    this.down = batch.down;
    if (count > 0) this.keepPrediction();
  }

  private keepPrediction(): void {
    const time = this.at(this.length - 1, 0, ROW.time);
    if (time < this.fanNext) return;
    this.fanNext = time + this.fanInterval;
    for (const [plane, fan] of this.fans.entries()) {
      const states = this.predictions[plane];
      if (states === undefined || states.length === 0) continue;
      fan.push({ time: time + this.samplingTime, samplingTime: this.samplingTime, states });
      if (fan.length > FAN) fan.shift();
    }
  }

  private place(index: number): number {
    return (this.total - this.length + index) % CAPACITY;
  }

  /** A column of the sample `index`, counted from the oldest that is kept. */
  at(index: number, plane: number, column: number): number {
    return this.data[this.place(index) * this.width + plane * ROW_WIDTH + column] ?? NaN;
  }

  motor(index: number, motor: number): number {
    return this.motorData[this.place(index) * 3 + motor] ?? NaN;
  }

  /** The status of the sample `index`. */
  statusAt(index: number): string {
    const sample = this.total - this.length + index;
    const after = bisect(this.statusFrom.length, (place) => (this.statusFrom[place]?.sample ?? 0) <= sample);
    return this.statusFrom[after - 1]?.text ?? "";
  }

  /** A value of the state now: time, phi, theta, phi_dot, theta_dot, phi_ref. */
  nowAt(plane: number, column: number): number {
    return this.now[plane * NOW_WIDTH + column] ?? 0;
  }

  /** The first sample at or after the time, s. */
  indexAt(time: number): number {
    return bisect(this.length, (index) => this.at(index, 0, ROW.time) < time);
  }
}
