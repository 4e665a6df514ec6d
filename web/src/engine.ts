// The page's end of the worker.

import type { Answers, Batch, Call, FromWorker, RunOrder } from "./protocol";

/** Whatever delivers batches: the simulation, or a recorded file. */
export interface Source {
  onBatch: (batch: Batch) => void;
  run(order: RunOrder): void;
}

type Waiting = { resolve: (value: never) => void; reject: (error: Error) => void };

/** Time between two looks after the worker, ms. */
const LOOK = 500;
/** After so many looks without a word from it the worker is ended. Looks are counted, not time: a page
 *  that was held up itself has heard nothing either. */
const PATIENCE = 4;
/** The same while it owes an answer: how exact a guaranteed loop's plans have to be is searched for when
 *  a set-up is taken in, which takes seconds on a slow machine. */
const PATIENCE_WITH_CALLS = 20;

/** There will be no answer: the worker was ended, which `onSilence` says. */
export class NoAnswer extends Error {}

export class Engine implements Source {
  onBatch: (batch: Batch) => void = () => {};
  onFailure: (text: string) => void = () => {};
  /** The worker did not answer for so many seconds; another one, which knows of nothing, has taken its
   *  place. */
  onSilence: (seconds: number) => void = () => {};
  private worker = this.start();
  private readonly waiting = new Map<number, Waiting>();
  private nextId = 0;
  /** Looks since the last word from the worker; `undefined` before its first one, for which a slow
   *  line may need its time. */
  private silentFor: number | undefined;
  /** The worker's script could not be loaded. */
  private isMissing = false;

  constructor() {
    setInterval(() => this.look(), LOOK);
  }

  private start(): Worker {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.receive(data);
    // A script that cannot be loaded leaves no message.
    worker.onerror = ({ message }) => {
      this.isMissing = this.silentFor === undefined;
      this.fail(message || "the controller's program cannot be loaded");
    };
    return worker;
  }

  private look(): void {
    if (this.silentFor === undefined) return;
    if (this.silentFor === 0) this.worker.postMessage({ ping: true });
    const patience = this.waiting.size > 0 ? PATIENCE_WITH_CALLS : PATIENCE;
    if (this.silentFor++ < patience) return;
    this.worker.terminate();
    this.silentFor = undefined;
    this.worker = this.start();
    this.rejectAll(new NoAnswer());
    this.onSilence((patience * LOOK) / 1000);
  }

  /** Asks the worker; rejects with its message. */
  call<K extends Call["kind"]>(call: Extract<Call, { kind: K }>): Promise<Answers[K]> {
    if (this.isMissing) {
      // It would never answer; the line may be there again.
      this.isMissing = false;
      this.worker.terminate();
      this.worker = this.start();
    }
    const id = this.nextId++;
    this.worker.postMessage({ id, call });
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  run(order: RunOrder): void {
    this.worker.postMessage({ run: order });
  }

  /** Nobody waits for answers that will not come. */
  private rejectAll(error: Error): void {
    for (const { reject } of this.waiting.values()) reject(error);
    this.waiting.clear();
  }

  private fail(reason: string): void {
    this.rejectAll(new Error(reason));
    this.onFailure(reason);
  }

  private receive(message: FromWorker): void {
    this.silentFor = 0;
    if ("pong" in message) return;
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
