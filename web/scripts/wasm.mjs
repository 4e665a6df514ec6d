// Builds crates/ballbot-web for WebAssembly into src/generated: module, JavaScript and types.
import { execFileSync, spawn } from "node:child_process";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import binaryen from "binaryen";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const root = dirname(web);
const generated = join(web, "src", "generated");
// A folder of its own: another compiler may be at work here than in the main build.
const target = join(process.env.CARGO_TARGET_DIR ?? join(root, "target"), "cross");

function run(program, args, env = {}) {
  execFileSync(program, args, { cwd: root, stdio: "inherit", env: { ...process.env, ...env } });
}

// Built beside the module, whose last step takes one core.
const bindgen = ["--locked", "--quiet", "--manifest-path", join(web, "bindgen", "Cargo.toml")];
const tool = spawn("cargo", ["build", ...bindgen], { cwd: root, stdio: "inherit" });
const toolBuilt = new Promise((resolve, reject) => {
  tool.on("error", reject);
  tool.on("exit", (code) => (code === 0 ? resolve() : reject(new Error(`cargo build of web/bindgen: exit ${code}`))));
});

const triple = "wasm32-unknown-unknown";
run(join(root, ".ci", "cross-cargo.sh"),
  [triple, "build", "--locked", "--profile", "web", "-p", "ballbot-web"],
  // Where in the sources a panic would have been: nobody would see it, it takes 3 kB, and the paths
  // are those of the machine that builds. The option is unstable; the stable compiler takes it so.
  // Less inlining is 6 kB less to load, and no slower.
  { CARGO_TARGET_DIR: target, RUSTFLAGS: "-Zlocation-detail=none -Cllvm-args=-inline-threshold=30", RUSTC_BOOTSTRAP: "1" });
rmSync(generated, { recursive: true, force: true });
mkdirSync(generated, { recursive: true });
await toolBuilt;
run("cargo", ["run", ...bindgen, "--",
  join(target, triple, "web", "ballbot_web.wasm"), generated]);
const module = join(generated, "ballbot_web_bg.wasm");
writeFileSync(module, withoutPanicTexts(readFileSync(module)));
run(process.execPath, [join(web, "node_modules", "binaryen", "bin", "wasm-opt"),
  // What rustc uses for this target, and every browser of the last years has.
  "--enable-bulk-memory", "--enable-bulk-memory-opt", "--enable-call-indirect-overlong",
  "--enable-multivalue", "--enable-mutable-globals", "--enable-nontrapping-float-to-int",
  "--enable-reference-types", "--enable-sign-ext",
  // Repeated code compresses well, inlined code does not: -Oz, which inlines, makes fewer bytes
  // and a tenth more to load. Instances of one generic function have almost one name, so sorting
  // by names puts them side by side. The other passes were kept for what they save: 1 kB together.
  "--always-inline-max-function-size", "1", "--flexible-inline-max-function-size", "1",
  "--one-caller-inline-max-function-size", "1", "--partial-inlining-ifs", "0",
  "--reorder-functions-by-name", "-O2", "--gufa-optimizing", "-O2", "--skip-pass=simplify-locals",
  "--strip-debug", "--strip-producers", "--strip-target-features", module, "-o", module]);

/** A panic ends the module, and nobody would see its text: the functions that make it become the
 *  end itself, and what only they need is left out. */
function withoutPanicTexts(bytes) {
  const panics = new RegExp("^(core|alloc)[^ ]*::(panicking::|(option|result)::(unwrap|expect)_failed" +
    "|slice::.*_fail|str::slice_error_fail|cell::panic_already|raw_vec::handle_error)");
  binaryen.setDebugInfo(true);
  const program = binaryen.readBinary(bytes);
  for (let i = 0; i < program.getNumFunctions(); i++) {
    const made = program.getFunctionByIndex(i);
    if (panics.test(binaryen.getFunctionInfo(made).name)) binaryen.Function.setBody(made, program.unreachable());
  }
  return program.emitBinary();
}
