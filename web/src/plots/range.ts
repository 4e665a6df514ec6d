// Which values a strip shows, and where its axis has numbers.

import type { Range } from "../scenario";
import type { Strip } from "./strips";

/** A plan may stretch the scale to so many times what is there without it. */
const ROOM = 3;
/** Labels of an axis as a rule lie this far apart, px. */
const SPACING = 24;
/** Closer together they would touch, px. */
const CLOSEST = 12;
/** Numbers on one axis. */
const MOST_TICKS = 6;

/** 1, 2 or 5 times a power of ten: the largest that is not above `most`. */
export function niceStep(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most) + 1e-9);
  const digit = [5, 2, 1].find((candidate) => candidate * power <= most * (1 + 1e-9)) ?? 1;
  return digit * power;
}

/** Round numbers from `low` to `high`, at least two, on an axis of so many pixels. */
export function ticks(low: number, high: number, pixels: number): number[] {
  if (!(high > low && Number.isFinite(high - low))) return [];
  const wanted = Math.min(Math.max(Math.floor(pixels / SPACING), 2), MOST_TICKS);
  let step = niceStep(high - low);
  const first = () => Math.ceil(low / step - 1e-9);
  const last = () => Math.floor(high / step + 1e-9);
  while (last() - first() + 1 < wanted) step = niceStep(0.99 * step);
  const stride = Math.max(Math.ceil((CLOSEST * (high - low)) / (step * pixels)), 1);
  const multiples = Array.from({ length: last() - first() + 1 }, (_, i) => first() + i);
  // With zero, unless others are more.
  const choices = Array.from({ length: stride }, (_, offset) => multiples.filter((k) => (k - offset) % stride === 0));
  const chosen = choices.reduce((most, choice) => (choice.length > most.length ? choice : most));
  return chosen.map((k) => (k === 0 ? 0 : k * step));
}

/** At most three powers of ten, evenly spaced. */
export function decades(low: number, high: number): number[] {
  const [from, to] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
  const step = Math.max(Math.ceil((to - from) / 3), 1);
  const made: number[] = [];
  for (let exponent = from; exponent <= to; exponent += step) made.push(10 ** exponent);
  return made;
}

/** The range of a strip: of its data (`low` to `high`, `null` where there are none), and of the
 *  values that plans lead through, as far as they are finite and do not dwarf everything else. */
export function valueRange(strip: Strip, data: [number | null, number | null], plans: Iterable<number>, bounds: Range | undefined): [number, number] {
  let [low, high] = data.map((end) => (end !== null && Number.isFinite(end) ? end : 0)) as [number, number];
  if (strip.logarithmic) {
    low = Math.max(low, 1e-6);
    high = Math.max(high, low * 10);
    return [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(high))];
  }
  const between = bounds && Number.isFinite(bounds[1] - bounds[0]) ? bounds[1] - bounds[0] : 0;
  const room = ROOM * Math.max(high - low, between, 10 * strip.least);
  const [lowest, highest] = [low - room, high + room];
  for (const value of plans) {
    if (!Number.isFinite(value)) continue;
    low = Math.max(Math.min(low, value), lowest);
    high = Math.min(Math.max(high, value), highest);
  }
  if (strip.fromZero) return [0, Math.max(high * 1.1, strip.least)];
  const middle = (low + high) / 2;
  const half = Math.max(((high - low) / 2) * 1.1, strip.least);
  return [middle - half, middle + half];
}
