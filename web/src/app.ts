// The page's state: one set-up, the robots derived from it, and what they did.

import { Engine, NoAnswer, type Source } from "./engine";
import { readRecording, trajectoryCsv } from "./files";
import { History } from "./history";
import type { Offer } from "./message";
import * as link from "./link";
import { Live, timedPath } from "./live";
import { Playback } from "./playback";
import { PRESETS } from "./presets";
import { NOW, ROW } from "./layout";
import type { Answers, Batch, Call, PhiPair, RobotFacts } from "./protocol";
import { robotsNamed, type RobotKind } from "./robots";
import { toToml, withValue, type Scenario } from "./scenario";
import { PAPER_SHAPE, type FloorPoint } from "./scene/view";

export interface AppEvents {
  message(text: string, kind: "error" | "info", offer?: Offer): void;
  /** Another set-up was opened. */
  opened(): void;
  /** The set-up or the choice of robots changed. */
  setup(): void;
  /** New histories: what was drawn is void. */
  restarted(): void;
  /** Running or not. */
  running(): void;
  /** The scenario or the recording has come to its end. */
  ended(): void;
  /** Something was asked for or answered. */
  asked(): void;
}

/** Time between two predictions that are kept, s. */
const FAN_INTERVAL = 0.4;

function text(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

export class App {
  setup!: Scenario;
  preset = "";
  robots: RobotKind[] = robotsNamed([]);
  histories: History[] = [];
  references: Float64Array[][] = [];
  planes = 1;
  /** As ordered last, until it ends by itself. */
  isRunning = false;
  private isComplete = false;
  private speed = 1;
  private runOrders = 0;
  playback: Playback | undefined;
  playbackName = "";
  onBatch: (batch: Batch) => void = () => {};
  private readonly engine = new Engine();
  private readonly live = new Live();
  private facts: RobotFacts[] = [];
  /** The planes of the set-up, also while a recording is played and after the controller was ended. */
  private ownPlanes = 1;
  private clock = 0;
  private clockAt = 0;
  /** The time that is looked back at while nothing runs, s. */
  private lookedAt: number | undefined;
  /** The last settings under which a sample was computed. */
  private working: { setup: Scenario; robots: RobotKind[]; preset: string } | undefined;
  /** The last target; what the worker's batches say of it comes later. */
  ordered: FloorPoint | undefined;
  /** Changes that are not taken in yet. */
  private waiting = 0;
  private queue: Promise<unknown> = Promise.resolve();
  /** The orders that are not answered yet. */
  private told: Promise<unknown> = Promise.resolve();
  private unanswered = 0;
  /** The last order to run or stop was heard. */
  private isHeard = true;

  constructor(private readonly events: AppEvents) {
    this.engine.onBatch = (batch) => {
      if (this.takesOrders()) this.receive(batch);
    };
    this.engine.onFailure = (reason) => this.failed(reason);
    this.engine.onSilence = (seconds) => this.stalled(seconds);
  }

  /** There is no robot any more that would take orders. */
  private forgetWorker(): void {
    this.facts = [];
    this.isHeard = true;
    if (!this.playback) this.setRunning(false);
  }

  private failed(reason: string): void {
    this.forgetWorker();
    this.events.message(reason, "error");
  }

  /** The worker was ended since it did not answer; the one in its place waits for a set-up. */
  private stalled(seconds: number): void {
    const { working } = this;
    const text = `The controller did not answer for ${seconds} s and was ended: with these settings one sample takes too long. ` +
      "A shorter horizon, fewer sub-steps or fewer QPs make it faster.";
    this.forgetWorker();
    this.events.message(text, "error", working && {
      label: "Go on with the last settings that worked",
      take: () => void this.attempt(() => this.open(working.setup, working.robots, working.preset)),
    });
  }

  /** Opens the link in the address or the first preset; `false` if there is neither. */
  async start(fragment: string): Promise<boolean> {
    if (fragment !== "" && (await this.openLink(fragment))) return true;
    return this.openPreset(PRESETS[0]?.name ?? "");
  }

  /** One thing after the other: a slider may move faster than its last value is taken in. */
  private inOrder<T>(work: () => Promise<T>): Promise<T> {
    this.waiting++;
    this.events.asked();
    const result = this.queue.then(work, work).finally(() => {
      this.waiting--;
      this.events.asked();
    });
    this.queue = result.catch(() => {});
    return result;
  }

  /** Does what was asked for when the changes before it are taken in: it is meant for what is then
   *  there. */
  afterChanges(work: () => void): void {
    void this.queue.then(work);
  }

  /** The same for what writes down the orders before it: when these are answered, too. */
  afterOrders(work: () => void): void {
    void this.queue.then(() => this.told).then(work);
  }

  /** No change is on its way. */
  get isSettled(): boolean {
    return this.waiting === 0;
  }

  /** Nor is anything else that was asked for: what is known is what came of it. */
  get isAnswered(): boolean {
    return this.isSettled && this.unanswered === 0 && this.isHeard;
  }

  /** Does it, or says why not and changes nothing. */
  private attempt(work: () => Promise<void>): Promise<boolean> {
    return this.inOrder(async () => {
      try {
        await work();
        return true;
      } catch (error) {
        this.complain(error);
        // Fields show what holds, not what was refused.
        if (this.facts.length > 0) this.show();
        return false;
      }
    });
  }

  /** Says what was wrong, unless it is said already. */
  private complain(error: unknown): void {
    if (!(error instanceof NoAnswer)) this.events.message(text(error), "error");
  }

  /** A field that goes on changing must not be set to what it was some changes ago. */
  private show(): void {
    if (this.waiting <= 1) this.events.setup();
  }

  private async configure(setup: Scenario, robots: RobotKind[], keep: boolean): Promise<void> {
    const setups = robots.map((robot) => ({ label: robot.label, setup: robot.derive(setup) }));
    const planes = this.planes;
    const { robots: facts, kept } = await this.engine.call({ kind: "configure", robots: setups, keep });
    this.playback?.stop();
    this.playback = undefined;
    this.lookedAt = undefined;
    [this.setup, this.robots, this.facts] = [setup, robots, facts];
    this.planes = this.ownPlanes = facts[0]?.planes ?? 1;
    if (!kept) {
      this.live.clear();
      this.ordered = undefined;
      this.isComplete = false;
      this.setRunning(false);
    }
    if (!kept || this.planes !== planes || this.histories.length !== facts.length) this.renew();
    for (const [i, history] of this.histories.entries()) {
      history.samplingTime = facts[i]?.sampling_time ?? history.samplingTime;
    }
    this.show();
  }

  private renew(): void {
    this.histories = this.facts.map(({ planes, sampling_time }) => new History(planes, sampling_time, FAN_INTERVAL));
    this.events.restarted();
  }

  async openPreset(name: string): Promise<boolean> {
    const preset = PRESETS.find((candidate) => candidate.name === name);
    return preset !== undefined && this.openToml(preset.text, name);
  }

  openToml(toml: string, preset: string): Promise<boolean> {
    return this.attempt(() => this.takeIn(toml, preset));
  }

  openLink(fragment: string): Promise<boolean> {
    return this.attempt(async () => {
      const { toml, robots } = await link.decode(fragment);
      await this.takeIn(toml, "", robots);
    });
  }

  private async takeIn(toml: string, preset: string, robots?: string[]): Promise<void> {
    const setup = await this.engine.call({ kind: "parse", toml });
    await this.open(setup, robotsNamed(robots ?? [setup.controller.model]), preset);
  }

  private async open(setup: Scenario, robots: RobotKind[], preset: string): Promise<void> {
    await this.configure(setup, robots, false);
    this.preset = preset;
    this.events.opened();
    this.show();
  }

  change(path: string, value: unknown): Promise<boolean> {
    return this.attempt(async () => {
      const setup = withValue(this.setup, path, value);
      await this.configure(setup, this.robots, !this.playback);
    });
  }

  chooseRobots(names: string[]): Promise<boolean> {
    return this.attempt(() => this.configure(this.setup, robotsNamed(names), false));
  }

  /** Angle of the wheels' contact points from the top of the ball, rad. */
  get zenith(): number {
    return this.facts[0]?.zenith ?? PAPER_SHAPE.zenith;
  }

  /** Azimuths of the wheels, rad. */
  get azimuths(): number[] {
    return this.facts[0]?.azimuths ?? PAPER_SHAPE.azimuths;
  }

  /** The ball radius: angles times this are lengths on the floor. */
  get radius(): number {
    return this.setup.parameters.ball_radius_m;
  }

  /** Hands an order to the worker, and what it says of it to `taken`. */
  private tell<K extends Call["kind"]>(call: Extract<Call, { kind: K }>, taken: (answer: Answers[K]) => void): void {
    this.unanswered++;
    this.events.asked();
    const answered = this.engine.call<K>(call).then(taken).catch((error: unknown) => this.complain(error)).finally(() => {
      this.unanswered--;
      this.events.asked();
    });
    this.told = Promise.all([this.told, answered]);
  }

  private phi({ x, y }: FloorPoint): PhiPair {
    return { x: x / this.radius, y: y / this.radius };
  }

  /** There is a robot, and it is not a recording. */
  private takesOrders(): boolean {
    return this.facts.length > 0 && !this.playback;
  }

  /** Sends the robots to a place, which is asked for when the changes before it are taken in. Here
   *  and below: whoever reaches into the scene wants to see what happens, so it runs from there on. */
  target(place: () => FloorPoint): void {
    this.afterChanges(() => this.sendTarget(place()));
  }

  /** Says no to what a file or a link could hold, and nothing would read back. */
  private isPlausible(what: string, pairs: PhiPair[], limit: "most_ball_angle" | "most_tilt_rate", unit: string, scale = 1): boolean {
    const most = this.setup["accept_unusual_values"] === true ? Number.MAX_VALUE : (this.facts[0]?.[limit] ?? 0);
    if (pairs.every(({ x, y }) => Math.abs(x) <= most && Math.abs(y) <= most)) return true;
    this.events.message(`${what} must be numbers, at most ${Number((most * scale).toPrecision(4))} ${unit}.`, "error");
    return false;
  }

  private arePlaces(places: PhiPair[]): boolean {
    return this.isPlausible("The x and y of a target", places, "most_ball_angle", "m", this.radius);
  }

  private sendTarget(at: FloorPoint): void {
    if (!this.takesOrders()) return;
    const phi = this.phi(at);
    if (!this.arePlaces([phi])) return;
    this.ordered = at;
    this.tell<"target">({ kind: "target", phi }, ({ time_s, dropped }) => this.live.target(at, time_s, dropped));
    this.run(true);
  }

  /** Sends the robots along a line from where they stand. */
  path(line: () => { points: FloorPoint[]; from: FloorPoint }): void {
    this.afterChanges(() => this.sendPath(line));
  }

  private sendPath(line: () => { points: FloorPoint[]; from: FloorPoint }): void {
    if (!this.takesOrders()) return;
    // It begins where they stand now, not where they are seen while somebody looks back.
    this.lookedAt = undefined;
    const { points, from } = line();
    const timed = timedPath(points, from);
    const called = timed.map((point) => ({ time_s: point.time_s, phi: this.phi(point) }));
    if (!this.arePlaces(called.map(({ phi }) => phi))) return;
    this.ordered = undefined;
    this.tell<"path">({ kind: "path", points: called }, (taken) =>
      this.live.path(timed.map((point) => ({ ...point, time_s: taken.time_s + point.time_s }))));
    this.run(true);
  }

  /** Pushes the bodies towards a direction: change of the lean's rates, rad/s. */
  push(towards: FloorPoint): void {
    this.afterChanges(() => this.sendPush(towards));
  }

  private sendPush(towards: FloorPoint): void {
    if (!this.takesOrders()) return;
    if (!this.isPlausible("The x and y of a push", [towards], "most_tilt_rate", "rad/s")) return;
    // The body leans towards +x where theta is negative.
    const push = { x: -towards.x, y: -towards.y };
    this.tell<"push">({ kind: "push", push }, ({ time_s }) => this.live.push(push.x, push.y, time_s));
    this.run(true);
  }

  /** What the button says: a run that is seen stops at once. */
  toggle(): void {
    if (!this.isRunning) {
      this.afterChanges(() => this.run(!this.isRunning));
      return;
    }
    this.run(false);
    // An order from before, which waits for a change, lets it run again.
    this.afterChanges(() => {
      if (this.isRunning) this.run(false);
    });
  }

  setSpeed(speed: number): void {
    this.order({ speed });
  }

  private run(running: boolean, source?: Source): void {
    this.order({ running }, source);
  }

  private order(order: { running?: boolean; speed?: number }, source: Source = this.playback ?? this.engine): void {
    this.lookedAt = undefined;
    [this.clock, this.clockAt] = [this.time(), performance.now()];
    this.speed = order.speed ?? this.speed;
    // The robots that come next run at the speed that was chosen before.
    if (!this.playback && this.facts.length === 0) return;
    if (order.running !== undefined) this.setRunning(order.running);
    this.isHeard = false;
    this.events.asked();
    source.run({ number: ++this.runOrders, ...order, speed: this.speed });
  }

  private setRunning(running: boolean): void {
    if (running === this.isRunning) return;
    this.isRunning = running;
    this.events.running();
  }

  step(): void {
    this.afterChanges(() => {
      this.lookedAt = undefined;
      if (this.playback) {
        this.playback.step();
        return;
      }
      this.run(false);
      this.tell<"step">({ kind: "step" }, () => {});
    });
  }

  reset(): void {
    void this.attempt(async () => {
      this.lookedAt = undefined;
      if (this.playback) this.playback.reset();
      else await this.configure(this.setup, this.robots, false);
    });
  }

  play(files: { name: string; text: string }[]): Promise<boolean> {
    return this.attempt(async () => {
      const { planes, name } = readRecording(files);
      const playback = new Playback(planes);
      this.run(false, this.engine);
      this.playback?.stop();
      this.playback = playback;
      this.playbackName = name;
      this.lookedAt = undefined;
      this.planes = planes.length;
      this.ordered = undefined;
      this.robots = this.robots.slice(0, 1);
      this.histories = [new History(planes.length, playback.samplingTime, FAN_INTERVAL)];
      this.references = [playback.references()];
      this.show();
      this.events.restarted();
      playback.onBatch = (batch) => this.receive(batch);
      this.run(true);
    });
  }

  private receive(batch: Batch): void {
    if (batch.restarted && this.histories.some(({ total }) => total > 0)) {
      this.histories = this.histories.map(({ planes, samplingTime }) => new History(planes, samplingTime, FAN_INTERVAL));
      this.events.restarted();
    }
    // A batch from before the last change of the robots is void.
    if (batch.robots.length !== this.histories.length) return;
    for (const [i, robot] of batch.robots.entries()) this.histories[i]?.add(robot);
    if (!this.playback && batch.robots.some(({ rows }) => rows.length > 0)) {
      this.working = { setup: this.setup, robots: this.robots, preset: this.preset };
    }
    if (batch.references) this.references = batch.references;
    [this.clock, this.clockAt] = [batch.clock, performance.now()];
    if (batch.order === this.runOrders) {
      this.isHeard = true;
      this.setRunning(batch.running);
    }
    if (batch.complete && !this.isComplete) this.events.ended();
    this.isComplete = batch.complete;
    this.onBatch(batch);
  }

  /** Looks back at a time of the run, s, as long as nothing runs. */
  look(time: number): void {
    if (!this.isRunning) this.lookedAt = time < this.sampleTime() ? time : undefined;
  }

  /** What is shown lies in the past. */
  get isLookingBack(): boolean {
    return this.lookedAt !== undefined;
  }

  /** The times that can be looked at, s. */
  get span(): [number, number] {
    const end = this.sampleTime();
    const kept = this.histories.filter(({ length }) => length > 0).map((history) => history.at(0, 0, ROW.time));
    return [Math.min(end, ...kept), end];
  }

  /** Simulated time for the eye, s. */
  time(): number {
    if (this.lookedAt !== undefined) return this.lookedAt;
    const elapsed = this.isRunning ? ((performance.now() - this.clockAt) / 1000) * this.speed : 0;
    return Math.min(this.clock + elapsed, this.sampleTime());
  }

  /** Time up to which the robots were simulated, s. */
  private sampleTime(): number {
    return Math.max(0, ...this.histories.map((history) => history.nowAt(0, NOW.time)));
  }

  private withOrders(): Scenario {
    return this.live.into(this.setup, this.ownPlanes);
  }

  /** The set-up as a file for `ballbot simulate`: the first robot, with what was done to it. */
  toml(): string {
    const setup = this.withOrders();
    return toToml(this.robots[0]?.derive(setup) ?? setup);
  }

  /** The run so far: a file per plane and robot. */
  csv(): { name: string; text: string }[] {
    const several = this.histories.length > 1;
    return this.histories.flatMap((history, i) => {
      const robot = several ? `_${this.robots[i]?.name ?? i}` : "";
      return Array.from({ length: history.planes }, (_, plane) => {
        const axis = history.planes === 1 ? "" : plane === 0 ? "_x" : "_y";
        return { name: `trajectory${robot}${axis}.csv`, text: trajectoryCsv(history, plane) };
      });
    });
  }

  async fragment(): Promise<string> {
    const setup = this.withOrders();
    return link.encode({ toml: toToml(setup), robots: this.robots.map(({ name }) => name) });
  }
}
