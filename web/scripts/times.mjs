// Median time per step of the built module (`npm run wasm`), N = 20, in the engine of Node, which is that of
// Chromium, in turn with that of the program (in the variable BALLBOT): other work on the machine changes the
// times, but hardly how many times as long the module takes. With `--fail` more than the limit is an error.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parse } from "smol-toml";

/** The engine optimises code that is called often, so a run is repeated, and the least median counts: of so many */
const ROUNDS = 4;
/** with so many runs of the module each, and one of the program. */
const RUNS = 10;
/** As many times the program's: with `opt-level = "s"` it is above that. */
const LIMIT = 2.5;

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const builtin = join(web, "..", "crates", "ballbot-scenario", "src", "builtin");
const program = process.env.BALLBOT ?? join(web, "..", "target", "release", "ballbot");
const read = (...path) => readFileSync(join(...path), "utf8");
const { initSync, Simulation } = await import(pathToFileURL(join(web, "src", "generated", "ballbot_web.js")).href);
initSync({ module: readFileSync(join(web, "src", "generated", "ballbot_web_bg.wasm")) });
const { certificate } = JSON.parse(read(builtin, "terminal-certificate.json"));

/** The text with another in place of all that match. */
function changed(text, pattern, other) {
  if (!pattern.test(text)) throw new Error(`no ${pattern} in the set-up`);
  return text.replaceAll(new RegExp(pattern, "gm"), other);
}

/** The page's first set-up, sent back and forth. */
const points = [0, 5, 0, 5, 0].map((phi, i) => `{ time_s = ${2 * i}.0, phi_rad = ${phi}.0 }`);
const short = changed(read(web, "presets", "drive.toml"), /^duration_s = .*$/m, "duration_s = 10.0");
const drive = changed(short, /^points = .*$/m, `points = [${points}]`);
const setups = {
  "paper's predictor": read(builtin, "two-setpoints.toml"),
  "default predictor": drive,
  "guaranteed loop": changed(drive, /"discrete_riccati"/, "{ certified = {} }"),
};

function median(times) {
  const finite = times.filter(Number.isFinite).sort((a, b) => a - b);
  return finite[finite.length >> 1];
}

function ofModule(toml) {
  const setup = parse(toml);
  const simulation = new Simulation(setup, certificate);
  const times = Array.from({ length: Math.round(setup.duration_s / setup.controller.t_s) }, () => {
    simulation.step();
    return simulation.row()[9];
  });
  simulation.free();
  return median(times);
}

function ofProgram(folder) {
  execFileSync(program, ["simulate", join(folder, "scenario.toml"), "--out", folder], { stdio: ["ignore", "ignore", "inherit"] });
  const first = readdirSync(folder).find((name) => /^trajectory(_x)?\.csv$/.test(name));
  const [header, ...rows] = read(folder, first).trim().split("\n").map((line) => line.split(","));
  return median(rows.map((row) => parseFloat(row[header.indexOf("step_us")])));
}

let over = false;
for (const [name, toml] of Object.entries(setups)) {
  const folder = mkdtempSync(join(tmpdir(), "ballbot-times-"));
  writeFileSync(join(folder, "scenario.toml"), toml);
  const [module, native] = [[], []];
  for (let round = 0; round < ROUNDS; round++) {
    for (let run = 0; run < RUNS; run++) module.push(ofModule(toml));
    native.push(ofProgram(folder));
  }
  rmSync(folder, { recursive: true });
  const [here, there] = [Math.min(...module), Math.min(...native)];
  const exceeded = !(here <= LIMIT * there);
  over ||= exceeded;
  const middle = median(module).toFixed(0);
  console.log(`${name.padEnd(18)}${here.toFixed(1).padStart(6)} us (${middle} in the middle), program ${there.toFixed(1)} us: ` +
    `${(here / there).toFixed(1)} times${exceeded ? `  (above ${LIMIT} times)` : ""}`);
}
process.exitCode = over && process.argv.includes("--fail") ? 1 : 0;
