// The licences of what is bundled into the page go along with it.
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const json = (path) => JSON.parse(readFileSync(path, "utf8"));
const texts = Object.keys(json(join(web, "package.json")).dependencies).map((name) => {
  const folder = join(web, "node_modules", name);
  return `${name} ${json(join(folder, "package.json")).version}\n\n${readFileSync(join(folder, "LICENSE"), "utf8")}`;
});
const rule = `\n${"=".repeat(78)}\n`;
writeFileSync(join(web, "dist", "licences.txt"), [
  "The page: MIT or Apache-2.0, Copyright 2026 The lpvmpc developers. It contains:\n",
  ...texts,
].join(rule));
