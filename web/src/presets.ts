// The set-ups that can be chosen: one to drive around with, and the program's built-in scenarios.

import drive from "../presets/drive.toml?raw";

/** A preset: its name and its TOML text. */
export interface Preset {
  name: string;
  text: string;
}

const files: Record<string, string> = import.meta.glob("../../crates/ballbot-scenario/src/builtin/*.toml", {
  query: "?raw",
  import: "default",
  eager: true,
});

export const PRESETS: Preset[] = [
  { name: "drive", text: drive },
  ...Object.entries(files).map(([path, text]) => ({ name: /([^/]*)\.toml$/.exec(path)?.[1] ?? path, text })),
];

/** The title in a scenario file. */
export function titleOf({ name, text }: Preset): string {
  return /^title\s*=\s*"(.*)"/m.exec(text)?.[1] ?? name;
}
