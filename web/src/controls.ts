// Buttons, tools, keys and dropped files.

import type { App } from "./app";
import { connectKeys } from "./keys";
import { byId } from "./page";
import type { Plots } from "./plots/plots";
import type { Pointer, Tool } from "./scene/pointer";
import type { View } from "./scene/view";

const SPEEDS: [number, string][] = [[1, "1\u00d7"], [0.5, "\u00bd\u00d7"], [0.25, "\u00bc\u00d7"], [0.1, "0.1\u00d7"], [0.02, "0.02\u00d7"]];
const HINTS: Record<Tool, string> = {
  target: "Click or drag on the floor: the robot goes there. Drag the robot: a push. Right button or two fingers: camera.",
  path: "Draw on the floor: the robot follows the line.",
  push: "Drag: the arrow is the push.",
  camera: "Drag to turn, wheel or two fingers to zoom.",
};

export interface Controlled {
  app: App;
  view: View;
  plots: Plots;
  pointer: Pointer;
  resized(): void;
  moveTarget(dx: number, dy: number): void;
  openFiles(files: File[]): void;
}

/** The set-up behind the #; empty if there is none, or a place of the page. */
export function linkInAddress(): string {
  const fragment = location.hash.slice(1);
  return document.getElementById(fragment) ? "" : fragment;
}

export function connectControls(controlled: Controlled): void {
  const { app } = controlled;
  connectRun(app);
  connectTools(controlled);
  connectPanelToggle(controlled);
  window.addEventListener("dragover", (event) => event.preventDefault());
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    controlled.openFiles([...(event.dataTransfer?.files ?? [])]);
  });
  window.addEventListener("hashchange", () => {
    const link = linkInAddress();
    if (link !== "") void app.openLink(link);
  });
  connectKeys(byId("scene"), {
    toggle: () => app.toggle(),
    step: () => app.step(),
    reset: () => app.reset(),
    moveTarget: (dx, dy) => controlled.moveTarget(dx, dy),
    push: (x, y) => app.push({ x, y }),
  });
}

function connectRun(app: App): void {
  byId("play").addEventListener("click", () => app.toggle());
  byId("step").addEventListener("click", () => app.step());
  byId("reset").addEventListener("click", () => app.reset());
  const speed = byId<HTMLSelectElement>("speed");
  for (const [value, text] of SPEEDS) speed.add(new Option(text, String(value)));
  speed.addEventListener("change", () => app.setSpeed(Number(speed.value)));
}

function connectTools({ view, plots, pointer }: Controlled): void {
  for (const input of document.querySelectorAll<HTMLInputElement>("input[name=tool]")) {
    input.addEventListener("change", () => {
      pointer.tool = input.value as Tool;
      view.setCameraTool(input.value === "camera");
      byId("hint").textContent = HINTS[pointer.tool];
    });
  }
  for (const input of document.querySelectorAll<HTMLInputElement>("input[name=plane]")) {
    input.addEventListener("change", () => plots.setPlane(Number(input.value)));
  }
  byId("hint").textContent = HINTS.target;
}

function connectPanelToggle({ resized }: Controlled): void {
  const toggle = byId("panel-toggle");
  toggle.addEventListener("click", () => {
    const hidden = document.body.classList.toggle("no-panel");
    toggle.setAttribute("aria-expanded", String(!hidden));
    resized();
  });
}
