// What is drawn into a chart besides its curves.

import uPlot from "uplot";
import { ROW } from "../protocol";
import type { Range } from "../scenario";
import { planeOf, type Shown } from "./columns";

/** Shades what is outside the bounds. */
export function shadeBounds(chart: uPlot, bounds: Range | undefined, colour: string): void {
  if (!bounds) return;
  const { ctx, bbox } = chart;
  const edge = (value: number) =>
    Math.min(Math.max(chart.valToPos(value, "y", true), bbox.top), bbox.top + bbox.height);
  const [top, bottom] = [edge(bounds[1]), edge(bounds[0])];
  ctx.save();
  ctx.fillStyle = colour;
  if (Number.isFinite(bounds[1])) ctx.fillRect(bbox.left, bbox.top, bbox.width, top - bbox.top);
  if (Number.isFinite(bounds[0])) ctx.fillRect(bbox.left, bottom, bbox.width, bbox.top + bbox.height - bottom);
  ctx.restore();
}

/** Draws within the axes only. */
function clipped({ ctx, bbox }: uPlot, draw: () => void): void {
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  draw();
  ctx.restore();
}

/** The plan ahead, and earlier plans behind what then happened: a component of their states. */
export function drawPredictions(chart: uPlot, component: number, shown: Shown[], chosen: number): void {
  const { ctx } = chart;
  const ratio = uPlot.pxRatio;
  const curve = (time: number, states: Float64Array, samplingTime: number) => {
    ctx.beginPath();
    for (let i = 0; 4 * i < states.length; i++) {
      const x = chart.valToPos(time + i * samplingTime, "x", true);
      ctx.lineTo(x, chart.valToPos(states[4 * i + component] ?? 0, "y", true));
    }
    ctx.stroke();
  };
  clipped(chart, () => {
    for (const { history, colour } of shown) {
      const plane = planeOf(history, chosen);
      ctx.strokeStyle = colour;
      ctx.lineWidth = ratio;
      ctx.globalAlpha = 0.35;
      for (const { time, states } of history.fans[plane] ?? []) curve(time, states, history.samplingTime);
      ctx.globalAlpha = 0.9;
      ctx.setLineDash([3 * ratio, 3 * ratio]);
      const states = history.predictions[plane];
      if (states) curve(history.nowAt(plane, ROW.time), states, history.samplingTime);
      ctx.setLineDash([]);
    }
  });
}

/** A line at the present. */
export function drawNow(chart: uPlot, time: number, colour: string): void {
  const { ctx, bbox } = chart;
  clipped(chart, () => {
    ctx.globalAlpha = 0.5;
    ctx.strokeStyle = colour;
    ctx.lineWidth = uPlot.pxRatio;
    const now = Math.round(chart.valToPos(time, "x", true)) + 0.5;
    ctx.beginPath();
    ctx.moveTo(now, bbox.top);
    ctx.lineTo(now, bbox.top + bbox.height);
    ctx.stroke();
  });
}
