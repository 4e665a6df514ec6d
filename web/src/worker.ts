// The control loop, beside the page: samples at their own rate, whatever the screen does.

import init, { Simulation, check } from "./generated/ballbot_web.js";
import wasmUrl from "./generated/ballbot_web_bg.wasm?url";
import builtin from "../../crates/ballbot-scenario/src/builtin/terminal-certificate.json";
import { parse } from "smol-toml";
import type { Answers, Batch, Call, FromWorker, RobotBatch, RobotSetup, ToWorker } from "./protocol";
import { Recorder } from "./recorder";
import { referencesOn } from "./reference";
import type { Scenario } from "./scenario";

interface Robot {
  label: string;
  simulation: Simulation;
  recorder: Recorder;
}

/** At most this much is caught up after the machine was busy, s. */
const MOST_BEHIND = 0.1;
/** Time between two looks at the clock, ms. */
const TICK = 4;
/** After so long among samples it listens to the page, ms: where samples take longer than they last,
 *  the run falls behind the clock. */
const LONGEST_ABSENCE = 100;
/** Time between two batches, ms: one per frame of the screen. */
const BATCH = 15;
/** Samples after which a browser has seen which code is called often. */
const WARM_UP = 400;
/** At most this much is spent on them, ms. */
const MOST_WARM_UP = 200;

const { certificate } = builtin;

let robots: Robot[] = [];
let running = false;
let speed = 1;
let order = 0;
let clock = 0;
let lastTick = 0;
let lastBatch = 0;
let restarted = false;
let referencesChanged = false;
let completed = false;
let warm = false;
/** Why the control loop has ended for good. */
let failure = "";

function post(message: FromWorker, transfer: Transferable[] = []): void {
  self.postMessage(message, { transfer });
}

function send(): void {
  const batch: Batch = {
    clock,
    running,
    order,
    restarted,
    complete: completed,
    robots: robots.map(({ recorder, simulation }): RobotBatch => recorder.take(simulation)),
  };
  if (referencesChanged) {
    batch.references = robots.map(({ simulation }) => referencesOn(simulation));
  }
  restarted = false;
  referencesChanged = false;
  lastBatch = performance.now();
  post({ batch }, batch.robots.flatMap(({ rows, motors }) => [rows.buffer, motors.buffer]));
}

function sampleAll(): void {
  for (const { simulation, recorder } of robots) recorder.sample(simulation);
}

/** Time of the next sample: of the robots that still move. Infinite when all lie on the floor. */
function nextTime(): number {
  const moving = robots.filter(({ simulation }) => !simulation.is_down());
  return Math.min(...moving.map(({ simulation }) => simulation.time()));
}

function endOfRun(): number {
  return Math.max(...robots.map(({ simulation }) => simulation.duration()));
}

/** Stops where the scenario ends, once; whoever lets it run on may do so. Stops for good when
 *  nothing moves any more. */
function stopAtTheEnd(): void {
  if (nextTime() === Infinity) {
    running = false;
    clock = endOfTimes();
    return;
  }
  if (!completed && nextTime() > endOfRun() - 1e-9) {
    completed = true;
    running = false;
    clock = nextTime();
  }
}

function tick(): void {
  try {
    advance();
    setTimeout(tick, TICK);
  } catch (error) {
    // The module cannot be trusted any more.
    [running, robots] = [false, []];
    failure = `the controller has stopped: ${error}. Load the page again.`;
    post({ failed: failure });
  }
}

function advance(): void {
  const now = performance.now();
  const elapsed = Math.min((now - lastTick) / 1000, MOST_BEHIND);
  lastTick = now;
  if (running && robots.length > 0) {
    clock += elapsed * speed;
    stopAtTheEnd();
    while (running && nextTime() <= clock) {
      sampleAll();
      stopAtTheEnd();
      if (running && performance.now() - now > LONGEST_ABSENCE) {
        clock = nextTime();
        break;
      }
    }
    if (now - lastBatch >= BATCH || !running) send();
  }
}

/** Browsers run a module's code as it comes, and optimise what is called often: without these
 *  steps, which nobody sees, the first ones of a run take three times as long as the later ones. The
 *  set-up is not prepared again, which may take longer than the page waits where it has asked nothing. */
function warmUp(): void {
  const simulation = robots[0]?.simulation.afresh();
  if (simulation === undefined) return;
  try {
    const end = performance.now() + MOST_WARM_UP;
    for (let k = 0; k < WARM_UP && performance.now() < end; k++) simulation.step();
  } finally {
    simulation.free();
  }
}

function configure(setups: RobotSetup[], keep: boolean): Answers["configure"] {
  const kept = keep && (running || robots.some(({ simulation }) => simulation.time() > 0));
  // Samples that come after the answer are those of the new set-up.
  if (robots.length > 0) send();
  const next: Robot[] = [];
  try {
    for (const [index, { label, setup }] of setups.entries()) {
      const before = kept ? robots[index] : undefined;
      const simulation = before
        ? before.simulation.reconfigured(setup, certificate)
        : new Simulation(setup, certificate);
      next.push({ label, simulation, recorder: before?.recorder ?? new Recorder() });
    }
  } catch (error) {
    for (const { simulation } of next) simulation.free();
    throw error;
  }
  for (const { simulation } of robots) simulation.free();
  robots = next;
  referencesChanged = true;
  if (!kept) {
    restarted = true;
    completed = false;
    running = false;
    clock = 0;
  }
  // After the answer, which tells the page how many robots there are.
  queueMicrotask(send);
  if (!warm) {
    warm = true;
    setTimeout(warmUp);
  }
  const facts = robots.map(({ label, simulation }) => ({
    label,
    most_ball_angle: simulation.most_ball_angle(),
    most_tilt_rate: simulation.most_tilt_rate(),
    planes: simulation.planes(),
    sampling_time: simulation.sampling_time(),
    horizon: simulation.horizon(),
    samples: simulation.samples(),
    zenith: simulation.zenith_angle(),
    azimuths: Array.from(simulation.azimuths()),
  }));
  return { robots: facts, kept };
}

/** The time of the robots that can still hear of it. */
function timeOfOrder(): number {
  const next = nextTime();
  return next < Infinity ? next : endOfTimes();
}

function endOfTimes(): number {
  return Math.max(...robots.map(({ simulation }) => simulation.time()));
}

function answer(call: Call): unknown {
  switch (call.kind) {
    case "parse": {
      const setup = parse(call.toml) as unknown as Scenario;
      const weights = check(setup, certificate);
      // The panel shows what is in use, and changes one of them.
      setup.controller.q ??= Array.from(weights.subarray(0, 4)) as Scenario["controller"]["q"];
      setup.controller.r ??= weights[4] ?? NaN;
      return setup;
    }
    case "configure":
      return configure(call.robots, call.keep);
    case "step":
      running = false;
      sampleAll();
      if (nextTime() < Infinity) clock = nextTime();
      stopAtTheEnd();
      send();
      return null;
    case "target": {
      const taken = robots.map(({ simulation }) => simulation.set_target(call.phi.x, call.phi.y));
      referencesChanged = true;
      send();
      return { time_s: timeOfOrder(), dropped: Array.from(taken[0] ?? []) };
    }
    case "path": {
      const from = timeOfOrder();
      const times = Float64Array.from(call.points, ({ time_s }) => from + time_s);
      const x = Float64Array.from(call.points, ({ phi }) => phi.x);
      const y = Float64Array.from(call.points, ({ phi }) => phi.y);
      for (const { simulation } of robots) simulation.set_path(times, x, y);
      referencesChanged = true;
      send();
      return { time_s: from };
    }
    case "push":
      for (const { simulation } of robots) simulation.push(call.push.x, call.push.y);
      return { time_s: timeOfOrder() };
  }
}

async function start(): Promise<void> {
  try {
    await init({ module_or_path: wasmUrl });
  } catch (error) {
    throw new Error(`the controller's WebAssembly module cannot be loaded: ${error}`);
  }
  lastTick = performance.now();
  tick();
}

const started = start();

self.onmessage = async ({ data }: MessageEvent<ToWorker>) => {
  if ("ping" in data) {
    post({ pong: true });
    return;
  }
  try {
    await started;
    if (failure !== "") throw new Error(failure);
    if ("run" in data) {
      // The time before the order, if it did not run, is none of the run's.
      if (!running) lastTick = performance.now();
      ({ running = running, speed, number: order } = data.run);
      send();
    } else {
      post({ id: data.id, value: answer(data.call) });
    }
  } catch (error) {
    if ("id" in data) post({ id: data.id, error: error instanceof Error ? error.message : String(error) });
  }
};
