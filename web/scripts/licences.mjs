// The licences of what is bundled into the page go along with it: of the packages in its JavaScript and
// of the crates in its WebAssembly module.
import { execFileSync } from "node:child_process";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const json = (path) => JSON.parse(readFileSync(path, "utf8"));

function packages() {
  return Object.keys(json(join(web, "package.json")).dependencies).map((name) => {
    const folder = join(web, "node_modules", name);
    return { name: `${name} ${json(join(folder, "package.json")).version}`, text: readFileSync(join(folder, "LICENSE"), "utf8") };
  });
}

const cargo = (...args) => execFileSync("cargo", [...args, "--locked"], { cwd: dirname(web), encoding: "utf8", maxBuffer: 2 ** 28 });

/** The crates of the module, with the features that it uses, without what only helps to compile. */
function crates() {
  const target = "wasm32-unknown-unknown";
  const tree = cargo("tree", "-p", "ballbot-web", "-e", "normal,no-proc-macro", "--target", target, "--prefix", "none", "-f", "{p}");
  const used = new Set(tree.split("\n").map((line) => line.split(" ").slice(0, 2).join(" ")));
  const { packages: all } = JSON.parse(cargo("metadata", "--format-version", "1", "--filter-platform", target));
  return all.filter(({ name, version, source }) => source !== null && used.has(`${name} v${version}`)).map(licenceOf);
}

/** One licence where a crate leaves the choice: the shortest text. */
function licenceOf({ name, version, license, manifest_path: manifest }) {
  const folder = dirname(manifest);
  const files = readdirSync(folder).filter((file) => /^(licen[cs]e|copying|unlicense)/i.test(file) && !file.endsWith(".rs"));
  const texts = files.map((file) => readFileSync(join(folder, file), "utf8")).sort((a, b) => a.length - b.length);
  return { name: `${name} ${version} (${license})`, text: texts[0] ?? "Its package holds no text of the licence.\n" };
}

/** Many have the same text: it is written once, below all their names. */
const byText = new Map();
for (const { name, text } of [...packages(), ...crates()].sort((a, b) => a.name.localeCompare(b.name))) {
  const key = text.replaceAll("\r", "").trim();
  byText.set(key, [...(byText.get(key) ?? []), name]);
}
const rule = `\n${"=".repeat(78)}\n`;
writeFileSync(join(web, "dist", "licences.txt"), `${[
  "The page: MIT or Apache-2.0, Copyright 2026 The lpvmpc developers. It contains the standard library\n" +
    "of Rust (MIT or Apache-2.0, https://www.rust-lang.org) and:\n",
  ...[...byText].map(([text, names]) => `${names.join("\n")}\n\n${text}\n`),
].join(rule)}`);
