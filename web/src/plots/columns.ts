// From the histories of the robots to the columns of a chart.

import type uPlot from "uplot";
import type { History } from "../history";
import { ROW } from "../protocol";
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

/** One column of times, then the columns of every robot. Robots may have stopped early. */
export function columns(strip: Strip, shown: Shown[], chosen: number, start: number): uPlot.AlignedData {
  const longest = shown.map(({ history }) => history).reduce<History | undefined>(
    (most, history) => (most === undefined || history.total > most.total ? history : most), undefined);
  if (!longest || longest.length === 0) return [[], ...emptyColumns(strip, shown.length)];
  const from = Math.max(longest.indexAt(start) - 1, 0);
  const stride = Math.max(Math.ceil((longest.length - from) / MOST_POINTS), 1);
  const indices: number[] = [];
  for (let i = from; i < longest.length; i += stride) indices.push(i);
  const end = longest.nowAt(0, ROW.time);
  const times = [...indices.map((i) => longest.at(i, 0, ROW.time)), end];
  const made: (number | null)[][] = [];
  for (const { history } of shown) {
    const offset = longest.total - longest.length - (history.total - history.length);
    const column = (value: (i: number) => number, final: number) => {
      const values = indices.map((i) => {
        const at = i + offset;
        const known = at >= 0 && at < history.length ? value(at) : NaN;
        return Number.isFinite(known) ? known : null;
      });
      made.push([...values, history === longest && Number.isFinite(final) ? final : null]);
    };
    const plane = planeOf(history, chosen);
    const last = history.length - 1;
    if (strip.motors) {
      for (let motor = 0; motor < 3; motor++) column((i) => history.motor(i, motor), history.motor(last, motor));
    } else {
      const key = strip.column ?? ROW.phi;
      const final = strip.held ? history.at(last, plane, key) : history.nowAt(plane, key);
      column((i) => history.at(i, plane, key), final);
    }
  }
  if (strip.reference) {
    const plane = planeOf(longest, chosen);
    made.push([...indices.map((i) => longest.at(i, plane, ROW.phiReference)), longest.nowAt(plane, 5)]);
  }
  return [times, ...made] as uPlot.AlignedData;
}

function emptyColumns(strip: Strip, robots: number): number[][] {
  const perRobot = strip.motors ? 3 : 1;
  return Array.from({ length: robots * perRobot + (strip.reference ? 1 : 0) }, () => []);
}
