// Back in time: a slider over what is kept of the run, while it does not run.

import type { App } from "./app";
import { byId } from "./page";

/** Returns what shows the slider's place, and the time under the plots' pointer, s. */
export function connectReview(app: App, redraw: () => void): (pointed: number | undefined) => void {
  const slider = byId<HTMLInputElement>("review");
  const words = byId("reviewed");
  slider.addEventListener("input", () => {
    app.look(Number(slider.value));
    redraw();
  });
  return (pointed) => {
    const [from, until] = app.span;
    slider.disabled = app.isRunning || until <= from;
    // While it runs the slider stays at its end.
    if (slider.disabled) [slider.min, slider.max, slider.value] = ["0", "1", "1"];
    else [slider.min, slider.max, slider.value] = [String(from), String(until), String(app.time())];
    words.textContent = pointed === undefined ? "" : `at the pointer: ${pointed.toFixed(2)} s`;
  };
}
