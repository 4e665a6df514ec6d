// What the controllers do, in words and numbers, over the scene.

import type { History } from "./history";
import { ROW } from "./protocol";

/** Steps over which the time is taken. */
const STEPS = 400;
/** What a controller says of a plan that needs no attention; nothing before the first. */
const GOOD = new Set(["", "solved", "converged", "improved", "no improvement found"]);

export function median(values: number[]): number {
  if (values.length === 0) return NaN;
  const sorted = values.toSorted((a, b) => a - b);
  const middle = sorted.length >> 1;
  return sorted.length % 2 === 1 ? (sorted[middle] ?? NaN) : ((sorted[middle - 1] ?? NaN) + (sorted[middle] ?? NaN)) / 2;
}

/** Median time per step over all planes, microseconds. */
export function medianStep(history: History): number {
  const values: number[] = [];
  for (let i = Math.max(history.length - STEPS, 0); i < history.length; i++) {
    for (let plane = 0; plane < history.planes; plane++) {
      const value = history.at(i, plane, ROW.stepMicroseconds);
      if (Number.isFinite(value)) values.push(value);
    }
  }
  return median(values);
}

/** How many bounds are active in the last plans, and which. */
function activeBounds(history: History): string {
  let total = 0;
  for (let plane = 0; plane < history.planes; plane++) {
    total += history.length > 0 ? history.at(history.length - 1, plane, ROW.activeBounds) : 0;
  }
  if (!(total > 0)) return "";
  const named = history.activeBounds.flatMap((text, plane) =>
    text === "" ? [] : [history.planes === 1 ? text : `${"xy"[plane]}: ${text}`],
  );
  const count = `, ${total} active bound${total === 1 ? "" : "s"}`;
  return named.length > 0 ? `${count} (${named.join("; ")})` : count;
}

export interface Line {
  label: string;
  colour: string;
  history: History;
}

export class StatusList {
  constructor(private readonly host: HTMLElement) {}

  /** One line per robot. */
  show(lines: Line[]): void {
    while (this.host.children.length > lines.length) this.host.lastElementChild?.remove();
    for (const [i, { label, colour, history }] of lines.entries()) {
      const line = this.host.children[i] ?? this.host.appendChild(this.newLine());
      const [name, words, time] = line.querySelectorAll("span");
      if (!name || !words || !time) continue;
      name.textContent = label;
      name.className = `dot ${colour.slice(2)}`;
      words.textContent = (history.status || "ready") + activeBounds(history);
      const step = medianStep(history);
      time.textContent = Number.isFinite(step) ? `${step.toFixed(1)} \u00b5s per step (median)` : "";
      line.classList.toggle("bad", !GOOD.has(history.status));
    }
  }

  private newLine(): HTMLElement {
    const line = document.createElement("div");
    line.append(...["dot", "words", "time"].map((name) => {
      const part = document.createElement("span");
      part.className = name;
      return part;
    }));
    return line;
  }
}
