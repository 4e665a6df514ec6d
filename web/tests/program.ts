// What the program makes of a set-up, and whether the page makes the same.

import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "@playwright/test";
import { table, type Table } from "./page";

const ballbot = process.env["BALLBOT"] ?? "../target/release/ballbot";

/** What the program writes for a scenario, file by file. */
export function simulated(toml: string): (file: string) => string {
  const folder = mkdtempSync(test.info().outputPath("program-"));
  const file = join(folder, "scenario.toml");
  writeFileSync(file, toml);
  // A run that ends in a fall is written, too, and the program then fails.
  spawnSync(ballbot, ["simulate", file, "--out", folder], { stdio: "ignore" });
  return (name) => readFileSync(join(folder, name), "utf8");
}

const NUMBERS = ["t_s", "phi_rad", "theta_rad", "phi_dot_rad_s", "theta_dot_rad_s", "torque_nm", "phi_ref_rad", "cost"] as const;

/** How far two runs may be apart, column by column; the cost relative to itself where it is above 1. */
export type Apart = Record<(typeof NUMBERS)[number], number>;

/** Of every loop but the guaranteed one. */
const SAME = Object.fromEntries(NUMBERS.map((column) => [column, 1e-9])) as Apart;
/** Of the guaranteed loop, as docs/browser.md says. */
export const GUARANTEED: Apart = {
  t_s: 1e-9, phi_ref_rad: 1e-9, phi_rad: 1e-7, theta_rad: 1e-7, torque_nm: 1e-7, phi_dot_rad_s: 1e-6, theta_dot_rad_s: 1e-6, cost: 1e-5,
};

function expectRows(ours: Table, theirs: Table, rows: number, apart = SAME): void {
  for (const column of NUMBERS) {
    const [a, b] = [ours[column] ?? [], theirs[column] ?? []];
    const distances = Array.from({ length: rows }, (_, i) => {
      const [value, other] = [a[i] ?? NaN, b[i] ?? NaN];
      if (Number.isNaN(value) && Number.isNaN(other)) return 0;
      const scale = column === "cost" ? Math.max(1, Math.abs(other)) : 1;
      return Math.abs(value - other) / scale;
    });
    const i = distances.findIndex((distance) => !(distance < apart[column]));
    expect(i, `${column}, row ${i}: ${a[i]} and ${b[i]}`).toBe(-1);
  }
}

/** The same run from beginning to end. */
export function expectSame(here: string, there: string, apart = SAME): void {
  const [ours, theirs] = [table(here), table(there)];
  const rows = ours["t_s"]?.length ?? 0;
  expect(rows).toBe(theirs["t_s"]?.length);
  expectRows(ours, theirs, rows, apart);
}

/** A time shortly before the end of a run, s. */
export function beforeEnd(csv: string): number {
  return (table(csv)["t_s"]?.at(-3) ?? NaN) - 1e-9;
}

/** Of a run that follows orders, as docs/browser.md says. */
const ORDERED: Apart = { ...SAME, phi_dot_rad_s: 1e-8, theta_dot_rad_s: 1e-8 };

/** The same run as that of the set-up with its orders, up to a time, s. */
export function expectSameUntil(until: number, here: string, toml: string, file = "trajectory.csv"): void {
  const short = toml.replace(/^duration_s = .*$/m, `duration_s = ${until + 1}`);
  const [ours, theirs] = [table(here), table(simulated(short)(file))];
  const rows = ours["t_s"]?.findIndex((time) => time > until) ?? -1;
  expect(rows).toBeGreaterThan(5);
  expectRows(ours, theirs, rows, ORDERED);
}
