// The WebAssembly module beside the program, without a page: the same runs, column by column.

import { readFileSync } from "node:fs";
import { parse } from "smol-toml";
import { trajectoryCsv } from "../src/files";
import init, { Simulation } from "../src/generated/ballbot_web.js";
import { History } from "../src/history";
import { Recorder } from "../src/recorder";
import { referencesOn } from "../src/reference";
import { expect } from "@playwright/test";
import { test } from "./page";
import { expectSame, GUARANTEED, simulated } from "./program";

const BUILTIN = "../crates/ballbot-scenario/src/builtin";
const builtin = (name: string) => readFileSync(`${BUILTIN}/${name}.toml`, "utf8");
const far = builtin("far-setpoints");

async function simulationOf(toml: string): Promise<Simulation> {
  await init({ module_or_path: readFileSync("src/generated/ballbot_web_bg.wasm") });
  const { certificate } = JSON.parse(readFileSync(`${BUILTIN}/terminal-certificate.json`, "utf8")) as { certificate: unknown };
  return new Simulation(parse(toml), certificate);
}

/** The run of a set-up in the module: trajectory.csv of its first plane. */
async function run(toml: string): Promise<string> {
  const simulation = await simulationOf(toml);
  const [recorder, history] = [new Recorder(), new History(simulation.planes(), simulation.sampling_time(), 1)];
  for (let k = 0; k < simulation.samples(); k++) recorder.sample(simulation);
  history.add(recorder.take(simulation));
  simulation.free();
  return trajectoryCsv(history, 0);
}

for (const name of ["two-setpoints", "two-setpoints-linear", "single-setpoint", "single-setpoint-terminal", "tight-bounds", "lissajous"]) {
  test(`the module's run of ${name} is the program's`, async () => {
    const toml = builtin(name);
    expectSame(await run(toml), simulated(toml)(name === "lissajous" ? "trajectory_x.csv" : "trajectory.csv"));
  });
}

for (const [name, toml] of [
  ["far-setpoints", far],
  ["far-setpoints with N = 40", far.replace("horizon = 20", "horizon = 40")],
  ["far-setpoints from 300 rad", far.replace("phi_rad = 100.0", "phi_rad = 300.0")],
] as const) {
  test(`the module's run of ${name}, guaranteed, is the program's within what the documentation says`, async () => {
    expectSame(await run(toml), simulated(toml)("trajectory.csv"), GUARANTEED);
  });
}

test("a path of seconds is seen on the floor, however long the run is, and after its end", async () => {
  const simulation = await simulationOf(readFileSync("presets/drive.toml", "utf8"));
  for (const begin of [0, 5000]) {
    simulation.set_path(Float64Array.from([begin, begin + 1, begin + 3]), Float64Array.from([0, 2, -1]), Float64Array.from([0, 0, 4]));
    const [x = [], y = []] = referencesOn(simulation);
    expect([x[0], x.at(-1), y.at(-1)]).toEqual([0, -1, 4]);
    expect(Math.max(...x)).toBeCloseTo(2, 1);
    const steps = Array.from(x).slice(1).map((value, i) => Math.hypot(value - (x[i] ?? NaN), (y[i + 1] ?? NaN) - (y[i] ?? NaN)));
    expect(Math.max(...steps)).toBeLessThan(0.05);
  }
  simulation.set_target(1, 2);
  expect(referencesOn(simulation).map((plane) => [...new Set(plane)])).toEqual([[1], [2]]);
  simulation.free();
});
