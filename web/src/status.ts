// What the controllers do, in words and numbers, over the scene.

import type { History } from "./history";
import { NOW, ROW } from "./layout";
import { usualStepInWords } from "./steptime";
import { TERMS } from "./terms";

/** What a controller says of a plan that needs no attention; nothing before the first. */
const GOOD = new Set(["", "solved", "converged", "improved", "no improvement found"]);

/** Whether what a controller says of a plan needs no attention. */
export function isGood(status: string): boolean {
  return GOOD.has(status);
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

/** What a robot does, and whether that needs no attention. */
export function stateOf(history: History, at: number | undefined): { text: string; isGood: boolean } {
  // A controller that still answers does not make a robot stand. Its time ends on the floor.
  if (history.down && (at ?? Infinity) >= history.nowAt(0, NOW.time)) return { text: "on the floor", isGood: false };
  const status = at === undefined ? history.status : history.statusAt(Math.max(history.indexAt(at + 1e-9) - 1, 0));
  // The bounds are those of the last plan.
  const bounds = at === undefined ? activeBounds(history) : "";
  return { text: (status || "ready") + bounds, isGood: isGood(status) && !hasEnded(history, at) };
}

/** It does not stand any more: now, or at a time that is looked back at, s. */
function hasEnded({ ending, endedAt = Infinity }: History, at: number | undefined): boolean {
  return ending !== undefined && (at === undefined || at >= endedAt);
}

/** Why robots do not stand any more, a line for each. */
export function endingsInWords(lines: Line[], at: number | undefined): string {
  return lines.filter(({ history }) => hasEnded(history, at)).map(({ label, history }) => `${label}: ${history.ending}`).join("\n");
}

export interface Line {
  label: string;
  colour: string;
  history: History;
}

export class StatusList {
  constructor(private readonly host: HTMLElement) {}

  /** One line per robot: what it does now, or did `at` a time that is looked back at, s. */
  show(lines: Line[], at: number | undefined): void {
    while (this.host.children.length > lines.length) this.host.lastElementChild?.remove();
    for (const [i, { label, colour, history }] of lines.entries()) {
      const line = this.host.children[i] ?? this.host.appendChild(this.newLine());
      const [name, words, time] = line.querySelectorAll("span");
      if (!name || !words || !time) continue;
      name.textContent = label;
      name.className = `dot ${colour.slice(2)}`;
      const { text, isGood } = stateOf(history, at);
      words.textContent = text;
      words.title = `Active bounds: ${TERMS.activeBound}`;
      time.textContent = history.down ? "" : usualStepInWords(history);
      line.classList.toggle("bad", !isGood);
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
