// Builds crates/ballbot-web for WebAssembly into src/generated: module, JavaScript and types.
import { execFileSync } from "node:child_process";
import { mkdirSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const root = dirname(web);
const generated = join(web, "src", "generated");
// A folder of its own: another compiler may be at work here than in the main build.
const target = join(process.env.CARGO_TARGET_DIR ?? join(root, "target"), "cross");

function run(program, args, env = {}) {
  execFileSync(program, args, { cwd: root, stdio: "inherit", env: { ...process.env, ...env } });
}

const triple = "wasm32-unknown-unknown";
run(join(root, ".ci", "cross-cargo.sh"),
  [triple, "build", "--locked", "--profile", "web", "-p", "ballbot-web"],
  { CARGO_TARGET_DIR: target });
rmSync(generated, { recursive: true, force: true });
mkdirSync(generated, { recursive: true });
run("cargo", ["run", "--locked", "--release", "--quiet",
  "--manifest-path", join(web, "bindgen", "Cargo.toml"), "--",
  join(target, triple, "web", "ballbot_web.wasm"), generated]);
const module = join(generated, "ballbot_web_bg.wasm");
run(process.execPath, [join(web, "node_modules", "binaryen", "bin", "wasm-opt"),
  // What rustc uses for this target, and every browser of the last years has.
  "-Oz", "--enable-bulk-memory", "--enable-bulk-memory-opt", "--enable-call-indirect-overlong",
  "--enable-multivalue", "--enable-mutable-globals", "--enable-nontrapping-float-to-int",
  "--enable-reference-types", "--enable-sign-ext", module, "-o", module]);
