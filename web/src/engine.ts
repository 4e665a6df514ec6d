// The page's end of the worker.

import type { Answers, Batch, Call, FromWorker, RunOrder } from "./protocol";

/** Whatever delivers batches: the simulation, or a recorded file. */
export interface Source {
  onBatch: (batch: Batch) => void;
  run(order: RunOrder): void;
}

type Waiting = { resolve: (value: never) => void; reject: (error: Error) => void };

export class Engine implements Source {
  onBatch: (batch: Batch) => void = () => {};
  onFailure: (text: string) => void = () => {};
  private readonly worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  private readonly waiting = new Map<number, Waiting>();
  private nextId = 0;

  constructor() {
    this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.receive(data);
    // A script that cannot be loaded leaves no message.
    this.worker.onerror = ({ message }) => this.fail(message || "the controller's program cannot be loaded");
  }

  /** Asks the worker; rejects with its message. */
  call<K extends Call["kind"]>(call: Extract<Call, { kind: K }>): Promise<Answers[K]> {
    const id = this.nextId++;
    this.worker.postMessage({ id, call });
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  run(order: RunOrder): void {
    this.worker.postMessage({ run: order });
  }

  /** Nobody waits for answers that will not come. */
  private fail(reason: string): void {
    for (const { reject } of this.waiting.values()) reject(new Error(reason));
    this.waiting.clear();
    this.onFailure(reason);
  }

  private receive(message: FromWorker): void {
    if ("batch" in message) {
      this.onBatch(message.batch);
    } else if ("failed" in message) {
      this.fail(message.failed);
    } else {
      const waiting = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if ("error" in message) waiting?.reject(new Error(message.error));
      else waiting?.resolve(message.value as never);
    }
  }
}
