// Files that come in and go out: TOML set-ups, CSV runs.

import type { History } from "./history";
import { NOW, NOW_WIDTH, ROW, ROW_WIDTH } from "./layout";

/** Columns of trajectory.csv, as `ballbot simulate` writes it. */
export const COLUMNS = [
  "t_s", "phi_rad", "theta_rad", "phi_dot_rad_s", "theta_dot_rad_s", "torque_nm", "phi_ref_rad", "cost", "status", "step_us",
] as const;

/** A row per sample, then the state at the end without a torque. */
export function trajectoryCsv(history: History, plane: number): string {
  const lines: string[] = [COLUMNS.join(",")];
  // What is unknown, as the cost without a plan, is an empty cell.
  const cell = (value: number, text = String(value)) => (Number.isFinite(value) ? text : "");
  const plain = (text: string) => text.replaceAll(",", ";").replaceAll("\n", " ");
  for (let i = 0; i < history.length; i++) {
    const values = [ROW.time, ROW.phi, ROW.theta, ROW.phiDot, ROW.thetaDot, ROW.torque, ROW.phiReference, ROW.cost]
      .map((column) => cell(history.at(i, plane, column)));
    const step = history.at(i, plane, ROW.stepMicroseconds);
    lines.push(`${values.join(",")},${plain(history.statusAt(i))},${cell(step, step.toFixed(3))}`);
  }
  const now = [0, 1, 2, 3, 4].map((column) => history.nowAt(plane, column));
  lines.push(`${now.join(",")},,${history.nowAt(plane, NOW.phiReference)},,${plain(history.ending ?? "")},`);
  return `${lines.join("\n")}\n`;
}

/** A recorded run of one plane. */
export interface Recorded {
  rows: Float64Array[];
  statuses: string[];
  /** The last row: time, phi, theta, phi_dot, theta_dot, phi_ref. */
  final: Float64Array;
  ending: string;
}

/** Reads trajectory.csv. Throws with line and reason. */
export function readTrajectory(text: string, name: string): Recorded {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() !== "");
  const header = (lines[0] ?? "").split(",").map((column) => column.trim());
  const missing = COLUMNS.slice(0, 7).filter((column) => !header.includes(column));
  if (missing.length > 0) {
    throw new Error(`${name}: the column ${missing.join(", ")} is missing; it must have the columns of trajectory.csv: ${COLUMNS.join(", ")}`);
  }
  if (lines.length < 3) throw new Error(`${name}: there is nothing to play: a run has at least two rows below the header`);
  const place = (column: string) => header.indexOf(column);
  const places = COLUMNS.slice(0, 8).map(place);
  const rows: Float64Array[] = [];
  const statuses: string[] = [];
  let final: Float64Array | undefined;
  let ending = "";
  for (const [i, line] of lines.slice(1).entries()) {
    const cells = line.split(",");
    const number = (column: number, mayBeUnknown: boolean): number => {
      const cell = (cells[column] ?? "").trim();
      const value = cell === "" ? NaN : Number(cell);
      // The program writes the cost of a sample without a plan as it is.
      if (!Number.isFinite(value) && !(mayBeUnknown && ["", "inf", "-inf", "NaN"].includes(cell))) {
        throw new Error(`${name}, line ${i + 2}: "${cell}" in the column ${header[column] ?? column + 1} is not a number`);
      }
      return value;
    };
    const isLast = i === lines.length - 2;
    const values = places.map((column, k) => (column < 0 ? NaN : number(column, k >= 7 || (isLast && k === 5))));
    const status = place("status") < 0 ? "" : (cells[place("status")] ?? "");
    const before = rows.at(-1)?.[ROW.time] ?? -Infinity;
    if ((values[0] ?? NaN) <= before) throw new Error(`${name}, line ${i + 2}: the time does not increase`);
    if (isLast) {
      final = Float64Array.from([...values.slice(0, 5), values[6] ?? 0]);
      ending = status;
    } else {
      const row = new Float64Array(ROW_WIDTH);
      row.set(values);
      row[ROW.activeBounds] = NaN;
      row[ROW.stepMicroseconds] = place("step_us") < 0 ? NaN : Number(cells[place("step_us")] || NaN);
      row.set(row.subarray(ROW.phi, ROW.phi + 4), ROW.estimatePhi);
      rows.push(row);
      statuses.push(status);
    }
  }
  return { rows, statuses, final: final ?? new Float64Array(NOW_WIDTH), ending };
}

/** Reads the one plane of a run, or its two. Throws with the file and the reason. */
export function readRecording(files: { name: string; text: string }[]): { planes: Recorded[]; name: string } {
  const sorted = files.toSorted((a, b) => a.name.localeCompare(b.name));
  const name = sorted.map((file) => file.name).join(", ");
  const [x, y] = sorted.map((file) => file.name.toLowerCase());
  const arePlanes = x !== undefined && x.endsWith("_x.csv") && y === x.replace(/_x\.csv$/, "_y.csv");
  if (files.length > 2 || (files.length === 2 && !arePlanes)) {
    const right = "open one file, or the two planes of one run, named ..._x.csv and ..._y.csv";
    throw new Error(`${name}: these are not one run; ${right}`);
  }
  const planes = sorted.map((file) => readTrajectory(file.text, file.name));
  if (planes[0] && planes[1]) requireSameTimes(planes[0], planes[1], name);
  return { planes, name };
}

function requireSameTimes(x: Recorded, y: Recorded, name: string): void {
  const times = ({ rows }: Recorded) => rows.map((row) => row[0]);
  const [ours, theirs] = [times(x), times(y)];
  const rule = "the two planes of one run have the same times";
  // One plane may have ended before the other; then its last row says why.
  const shorter = ours.length < theirs.length ? x : y;
  if (ours.length !== theirs.length && shorter.ending === "") {
    throw new Error(`${name}: ${ours.length} samples and ${theirs.length} samples; ${rule}`);
  }
  for (const [i, time] of ours.slice(0, theirs.length).entries()) {
    if (time !== theirs[i]) throw new Error(`${name}, row ${i + 1}: t_s = ${time} and t_s = ${theirs[i]}; ${rule}`);
  }
}

/** Hands a file to the user. */
export function save(name: string, text: string, type: string): void {
  const link = document.createElement("a");
  const url = URL.createObjectURL(new Blob([text], { type }));
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** The text of a file. Throws with its name. */
export async function readText(file: File): Promise<{ name: string; text: string }> {
  try {
    return { name: file.name, text: await file.text() };
  } catch {
    // Browsers hand over a dropped folder as a file that cannot be read.
    throw new Error(`${file.name}: this cannot be read; if it is a folder, choose the files in it`);
  }
}

/** Lets the user choose files. */
export function choose(accept: string, multiple: boolean): Promise<File[]> {
  const input = document.createElement("input");
  input.type = "file";
  input.accept = accept;
  input.multiple = multiple;
  return new Promise((resolve) => {
    input.addEventListener("change", () => resolve([...(input.files ?? [])]));
    input.addEventListener("cancel", () => resolve([]));
    input.click();
  });
}
