// What a first visit loads, compressed, and what is above the limits; with `--fail` that is an error.
// The limits are for brotli, which most web hosts send; gzip is shown beside it.
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, gzipSync } from "node:zlib";

const LIMITS_KB = { wasm: 220, all: 500 };

const dist = join(dirname(dirname(fileURLToPath(import.meta.url))), "dist");
const files = readdirSync(dist, { recursive: true, withFileTypes: true }).filter((f) => f.isFile());
const sizes = files.map((file) => {
  const content = readFileSync(join(file.parentPath, file.name));
  return {
    name: file.name,
    brotli: brotliCompressSync(content).length / 1000,
    gzip: gzipSync(content, { level: 9 }).length / 1000,
  };
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
