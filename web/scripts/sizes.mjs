// What a first visit loads, compressed, and what is above the limits; with `--fail` that is an error.
// The limits are for brotli, which most web hosts send; gzip is shown beside it.
import { readdirSync, statSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const LIMITS_KB = { wasm: 220, all: 500 };
/** Loaded only by who asks for it. */
const LATER = "licences.txt";

const dist = join(dirname(dirname(fileURLToPath(import.meta.url))), "dist");
const files = readdirSync(dist, { recursive: true, withFileTypes: true }).filter((f) => f.isFile());
const loaded = files.filter(({ name }) => !/\.(br|gz)$/.test(name) && name !== LATER);
const sizes = loaded.map((file) => {
  const kilobytes = (ending) => statSync(join(file.parentPath, file.name + ending)).size / 1000;
  return { name: file.name, brotli: kilobytes(".br"), gzip: kilobytes(".gz") };
});
const sum = (kind) => sizes.reduce((total, size) => total + size[kind], 0);
sizes.push({ name: "all", brotli: sum("brotli"), gzip: sum("gzip") });
const shown = (kB) => `${kB.toFixed(1).padStart(7)} kB`;
console.log("     brotli        gzip");
let over = false;
for (const { name, brotli, gzip } of sizes) {
  const limit = name.endsWith(".wasm") ? LIMITS_KB.wasm : name === "all" ? LIMITS_KB.all : Infinity;
  const exceeded = brotli > limit;
  over ||= exceeded;
  console.log(`${shown(brotli)}  ${shown(gzip)}  ${name}${exceeded ? `  (above ${limit} kB)` : ""}`);
}
process.exitCode = over && process.argv.includes("--fail") ? 1 : 0;
