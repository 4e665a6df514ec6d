// Median time per step of the built module (`npm run wasm`), N = 20, in the engine of Node, which is
// that of Chromium. A run is repeated, since the engine optimises code that is called often.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parse } from "smol-toml";

const RUNS = 6;
const SAMPLES = 200;

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const builtin = join(web, "..", "crates", "ballbot-scenario", "src", "builtin");
const read = (...path) => readFileSync(join(...path), "utf8");
const { initSync, Simulation } = await import(pathToFileURL(join(web, "src", "generated", "ballbot_web.js")).href);
initSync({ module: readFileSync(join(web, "src", "generated", "ballbot_web_bg.wasm")) });
const { certificate } = JSON.parse(read(builtin, "terminal-certificate.json"));

const drive = parse(read(web, "presets", "drive.toml"));
const setups = {
  "paper's predictor": parse(read(builtin, "two-setpoints.toml")),
  "default predictor": drive,
  "guaranteed loop": { ...drive, controller: { ...drive.controller, terminal: { certified: {} } } },
};
for (const [name, setup] of Object.entries(setups)) {
  const medians = Array.from({ length: RUNS }, () => {
    const simulation = new Simulation(setup, certificate);
    const times = [];
    for (let k = 0; k < SAMPLES; k++) {
      if (k % 40 === 0 && setup === drive) simulation.set_target(k % 80 ? 5 : 0, 3);
      simulation.step();
      times.push(simulation.row()[9]);
    }
    simulation.free();
    return times.sort((a, b) => a - b)[SAMPLES / 2];
  });
  console.log(`${name.padEnd(18)} ${medians.map((time) => time.toFixed(0).padStart(5)).join("")} us`);
}
