// A recorded run, played as if it were running.

import type { Recorded } from "./files";
import { NOW, NOW_WIDTH, ROW, ROW_WIDTH } from "./layout";
import type { Batch, RunOrder } from "./protocol";
import type { Source } from "./engine";
import { LINE_POINTS } from "./scene/lines";
import { isGood } from "./status";

export class Playback implements Source {
  onBatch: (batch: Batch) => void = () => {};
  readonly samples: number;
  readonly samplingTime: number;
  private index = 0;
  private clock: number;
  private running = false;
  private speed = 1;
  private order = 0;
  private lastTick = 0;
  private restarted = true;
  private frame = 0;

  /** One recording, or those of the x plane and the y plane of one run. */
  constructor(private readonly planes: Recorded[]) {
    this.samples = Math.min(...planes.map(({ rows }) => rows.length));
    const [first, second] = [planes[0]?.rows[0], planes[0]?.rows[1] ?? planes[0]?.final];
    this.samplingTime = (second?.[0] ?? 0) - (first?.[0] ?? 0);
    this.clock = this.timeOf(0);
  }

  /** Per plane: phi_ref over the recording, thinned evenly to what a line on the floor holds. */
  references(): Float64Array[] {
    const points = Math.min(this.samples, LINE_POINTS);
    const stride = (this.samples - 1) / Math.max(points - 1, 1);
    return this.planes.map(({ rows }) =>
      Float64Array.from({ length: points }, (_, i) => rows[Math.round(i * stride)]?.[ROW.phiReference] ?? 0),
    );
  }

  run({ number, running = this.running, speed }: RunOrder): void {
    // At the end there is nothing left to play: it starts again.
    if (running && this.atEnd()) this.rewind();
    [this.running, this.speed, this.order] = [running, speed, number];
    this.lastTick = performance.now();
    this.send();
    if (running) this.nextFrame();
  }

  step(): void {
    this.running = false;
    // `index` is the first row that is not shown yet.
    this.clock = this.timeOf(this.index);
    this.send();
  }

  reset(): void {
    this.rewind();
    this.send();
  }

  /** Ends the playback for good. */
  stop(): void {
    this.running = false;
  }

  private rewind(): void {
    [this.index, this.clock, this.restarted] = [0, this.timeOf(0), true];
  }

  private atEnd(): boolean {
    return this.index >= this.samples && this.clock >= this.timeOf(this.samples);
  }

  /** There is one frame to come, however often it is asked for. */
  private nextFrame(): void {
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.tick());
  }

  private timeOf(index: number): number {
    const { rows, final } = this.planes[0] as Recorded;
    return (index < this.samples ? rows[index]?.[ROW.time] : (rows[index] ?? final)[0]) ?? 0;
  }

  private tick(): void {
    if (!this.running) return;
    const now = performance.now();
    this.clock += ((now - this.lastTick) / 1000) * this.speed;
    this.lastTick = now;
    if (this.clock >= this.timeOf(this.samples)) {
      this.clock = this.timeOf(this.samples);
      this.running = false;
    }
    this.send();
    this.nextFrame();
  }

  private send(): void {
    const from = this.index;
    while (this.index < this.samples && this.timeOf(this.index) <= this.clock) this.index++;
    const count = this.index - from;
    const rows = new Float64Array(count * this.planes.length * ROW_WIDTH);
    for (let i = 0; i < count; i++) {
      for (const [plane, { rows: all }] of this.planes.entries()) {
        const row = all[from + i];
        if (row) rows.set(row, (i * this.planes.length + plane) * ROW_WIDTH);
      }
    }
    const complete = this.atEnd();
    const ending = this.planes.find((plane) => plane.ending !== "")?.ending;
    this.onBatch({
      clock: this.clock,
      running: this.running,
      order: this.order,
      restarted: this.restarted,
      complete,
      robots: [
        {
          rows,
          motors: new Float64Array(count * 3).fill(NaN),
          statuses: Array.from({ length: count }, (_, i) => ({ from: i, text: this.statusOf(from + i) })).filter(
            ({ text }, i) => from + i === 0 || text !== this.statusOf(from + i - 1),
          ),
          now: this.now(),
          prediction: this.planes.map(() => new Float64Array(0)),
          activeBounds: [],
          down: false,
          ...(complete && ending !== undefined ? { ending } : {}),
        },
      ],
    });
    this.restarted = false;
  }

  /** The status of the plane that needs attention, if one does, as the control loop says it of a robot. */
  private statusOf(index: number): string {
    const statuses = this.planes.map((plane) => plane.statuses[index] ?? "");
    return statuses.find((status) => !isGood(status)) ?? statuses[0] ?? "";
  }

  private now(): Float64Array {
    const now = new Float64Array(this.planes.length * NOW_WIDTH);
    for (const [plane, { rows, final }] of this.planes.entries()) {
      // Where the shorter plane ends the longer one still has a row; its own final state comes later.
      const row = rows[this.index];
      if (row) {
        now.set(row.subarray(0, NOW.phiReference), plane * NOW_WIDTH);
        now[plane * NOW_WIDTH + NOW.phiReference] = row[ROW.phiReference] ?? 0;
      } else now.set(final, plane * NOW_WIDTH);
    }
    return now;
  }
}
