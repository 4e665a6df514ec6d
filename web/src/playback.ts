// A recorded run, played as if it were running.

import type { Recorded } from "./files";
import { NOW_WIDTH, ROW, ROW_WIDTH, type Batch } from "./protocol";
import type { Source } from "./engine";

export class Playback implements Source {
  onBatch: (batch: Batch) => void = () => {};
  readonly samples: number;
  readonly samplingTime: number;
  private index = 0;
  private clock = 0;
  private running = false;
  private speed = 1;
  private lastTick = 0;
  private restarted = true;
  private stopped = false;

  /** One recording, or those of the x plane and the y plane of one run. */
  constructor(private readonly planes: Recorded[]) {
    this.samples = Math.min(...planes.map(({ rows }) => rows.length));
    const [first, second] = [planes[0]?.rows[0], planes[0]?.rows[1] ?? planes[0]?.final];
    this.samplingTime = (second?.[0] ?? 0) - (first?.[0] ?? 0);
  }

  run(running: boolean, speed: number): void {
    [this.running, this.speed] = [running, speed];
    this.lastTick = performance.now();
    this.send();
    if (running) requestAnimationFrame(() => this.tick());
  }

  step(): void {
    this.running = false;
    this.clock = this.timeOf(Math.min(this.index + 1, this.samples));
    this.send();
  }

  reset(): void {
    [this.index, this.clock, this.restarted] = [0, this.timeOf(0), true];
    this.send();
  }

  /** Ends the playback for good. */
  stop(): void {
    this.stopped = true;
  }

  private timeOf(index: number): number {
    const { rows, final } = this.planes[0] as Recorded;
    return (index < this.samples ? rows[index]?.[ROW.time] : (rows[index] ?? final)[0]) ?? 0;
  }

  private tick(): void {
    if (!this.running || this.stopped) return;
    const now = performance.now();
    this.clock += ((now - this.lastTick) / 1000) * this.speed;
    this.lastTick = now;
    if (this.clock >= this.timeOf(this.samples)) {
      this.clock = this.timeOf(this.samples);
      this.running = false;
    }
    this.send();
    requestAnimationFrame(() => this.tick());
  }

  private send(): void {
    if (this.stopped) return;
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
    const complete = this.index >= this.samples && this.clock >= this.timeOf(this.samples);
    const ending = this.planes.find((plane) => plane.ending !== "")?.ending;
    const statuses = this.planes[0]?.statuses ?? [];
    this.onBatch({
      clock: this.clock,
      running: this.running,
      speed: this.speed,
      restarted: this.restarted,
      complete,
      robots: [
        {
          rows,
          motors: new Float64Array(count * 3).fill(NaN),
          statuses: Array.from({ length: count }, (_, i) => ({ from: i, text: statuses[from + i] ?? "" })).filter(
            ({ text }, i) => from + i === 0 || text !== statuses[from + i - 1],
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

  private now(): Float64Array {
    const now = new Float64Array(this.planes.length * NOW_WIDTH);
    for (const [plane, { rows, final }] of this.planes.entries()) {
      const row = rows[this.index];
      if (this.index < this.samples && row) {
        now.set(row.subarray(0, 5), plane * NOW_WIDTH);
        now[plane * NOW_WIDTH + 5] = row[ROW.phiReference] ?? 0;
      } else now.set(final, plane * NOW_WIDTH);
    }
    return now;
  }
}
