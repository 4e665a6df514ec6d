// From the histories of the robots to the columns of a chart.

import type uPlot from "uplot";
import type { History } from "../history";
import { NOW, ROW } from "../layout";
import { stepAt } from "../steptime";
import type { Strip } from "./strips";

/** Points of a curve; more would not be seen. */
const MOST_POINTS = 900;

/** A robot in the charts. */
export interface Shown {
  history: History;
  colour: string;
}

/** The plane that a robot shows when this one is chosen. */
export function planeOf(history: History, chosen: number): number {
  return Math.min(chosen, history.planes - 1);
}

/** What a strip shows of a sample: one value, or one of each motor. */
export function valuesAt(strip: Strip, history: History, index: number, plane: number): number[] {
  if (strip.motors) return [0, 1, 2].map((motor) => history.motor(index, motor));
  if (strip.column === ROW.stepMicroseconds) return [stepAt(history, index, plane)];
  return [history.at(index, plane, strip.column ?? ROW.phi)];
}

/** One column of times, then the columns of every robot, for a chart from `start` to `end`, s. Robots may have
 *  stopped early. */
export function columns(strip: Strip, shown: Shown[], chosen: number, [start, end]: [number, number]): uPlot.AlignedData {
  const longest = shown.map(({ history }) => history).reduce<History | undefined>(
    (most, history) => (most === undefined || history.total > most.total ? history : most), undefined);
  if (!longest || longest.length === 0) return [[], ...emptyColumns(strip, shown.length)];
  const from = Math.max(longest.indexAt(start) - 1, 0);
  // The curves lead out of the chart on both sides.
  const until = Math.min(longest.indexAt(end) + 1, longest.length);
  const stride = Math.max(Math.ceil((until - from) / MOST_POINTS), 1);
  const indices: number[] = [];
  for (let i = from; i < until; i += stride) indices.push(i);
  const times = indices.map((i) => longest.at(i, 0, ROW.time));
  const reachesNow = until === longest.length;
  if (reachesNow) times.push(longest.nowAt(0, NOW.time));
  const made: (number | null)[][] = [];
  for (const { history } of shown) {
    const offset = longest.total - longest.length - (history.total - history.length);
    const plane = planeOf(history, chosen);
    const known = indices.map((i) => {
      const at = i + offset;
      return at >= 0 && at < history.length ? valuesAt(strip, history, at, plane) : [];
    });
    const last = history.length - 1;
    const final = strip.held ? valuesAt(strip, history, last, plane) : [history.nowAt(plane, strip.column ?? ROW.phi)];
    for (let curve = 0; curve < final.length; curve++) {
      const values = known.map((all) => all[curve] ?? NaN);
      if (reachesNow) values.push(history === longest ? (final[curve] ?? NaN) : NaN);
      made.push(withGaps(values));
    }
  }
  if (strip.reference) {
    const plane = planeOf(longest, chosen);
    const values = indices.map((i) => longest.at(i, plane, ROW.phiReference));
    if (reachesNow) values.push(longest.nowAt(plane, NOW.phiReference));
    made.push(withGaps(values));
  }
  return [times, ...made] as uPlot.AlignedData;
}

/** Gaps in place of what is not a finite number. Without any, the numbers stay an array of plain
 *  numbers, which takes a third of the memory. */
function withGaps(values: number[]): (number | null)[] {
  return values.every(Number.isFinite) ? values : values.map((value) => (Number.isFinite(value) ? value : null));
}

function emptyColumns(strip: Strip, robots: number): number[][] {
  const perRobot = strip.motors ? 3 : 1;
  return Array.from({ length: robots * perRobot + (strip.reference ? 1 : 0) }, () => []);
}
