// The time per step, as exactly as the browser's clock tells it.

import type { History } from "./history";
import { ROW } from "./layout";

/** Steps over which the time is taken. */
const STEPS = 400;
/** Steps over which the plot averages where the clock is coarse. */
export const AVERAGED = 50;

/** Browsers give a page that is not isolated a clock with steps of 100 us or more: one step of the
 *  control reads as 0 or 100. The mean of many is right all the same. */
export const COARSE_CLOCK = !globalThis.crossOriginIsolated;

export function median(values: number[]): number {
  if (values.length === 0) return NaN;
  const sorted = values.toSorted((a, b) => a - b);
  const middle = sorted.length >> 1;
  return sorted.length % 2 === 1 ? (sorted[middle] ?? NaN) : ((sorted[middle - 1] ?? NaN) + (sorted[middle] ?? NaN)) / 2;
}

function mean(values: number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

/** The times of the steps from `from` up to `until`, us. */
function times(history: History, planes: number[], from: number, until: number): number[] {
  const values: number[] = [];
  for (let i = Math.max(from, 0); i < until; i++) {
    for (const plane of planes) {
      const value = history.at(i, plane, ROW.stepMicroseconds);
      if (Number.isFinite(value)) values.push(value);
    }
  }
  return values;
}

/** Usual time per step over all planes, us. */
export function usualStep(history: History): number {
  const values = times(history, [...Array(history.planes).keys()], history.length - STEPS, history.length);
  return COARSE_CLOCK ? mean(values) : median(values);
}

/** The same in words; nothing as long as it is not known. */
export function usualStepInWords(history: History): string {
  if (COARSE_CLOCK && history.length < AVERAGED) return "";
  const step = usualStep(history);
  if (!Number.isFinite(step)) return "";
  return COARSE_CLOCK ? `about ${step.toFixed(0)} \u00b5s per step (mean; coarse clock)` : `${step.toFixed(1)} \u00b5s per step (median)`;
}

/** The time of the sample `index` for a plot, us. */
export function stepAt(history: History, index: number, plane: number): number {
  if (!COARSE_CLOCK) return history.at(index, plane, ROW.stepMicroseconds);
  return mean(times(history, [plane], index + 1 - AVERAGED, index + 1));
}
