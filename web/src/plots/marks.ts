// What is drawn into a chart besides its curves.

import uPlot from "uplot";
import { NOW } from "../layout";
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

/** The plan ahead, and earlier plans behind what then happened: a component of their states. A plan
 *  of a controller that finds no way out may have any values: what is drawn ends just outside the
 *  axes, since a browser draws every dash of a line, however far away. */
export function drawPredictions(chart: uPlot, component: number, shown: Shown[], chosen: number): void {
  const { ctx, bbox } = chart;
  const ratio = uPlot.pxRatio;
  const [highest, lowest] = [bbox.top - bbox.height, bbox.top + 2 * bbox.height];
  const curve = (time: number, states: Float64Array, samplingTime: number) => {
    ctx.beginPath();
    for (let i = 0; 4 * i < states.length; i++) {
      const x = chart.valToPos(time + i * samplingTime, "x", true);
      const y = chart.valToPos(states[4 * i + component] ?? NaN, "y", true);
      if (Number.isNaN(x + y) || x > bbox.left + 2 * bbox.width) break;
      ctx.lineTo(x, Math.min(Math.max(y, highest), lowest));
    }
    ctx.stroke();
  };
  clipped(chart, () => {
    for (const { history, colour } of shown) {
      const plane = planeOf(history, chosen);
      ctx.strokeStyle = colour;
      ctx.lineWidth = ratio;
      ctx.globalAlpha = 0.35;
      ctx.setLineDash([]);
      for (const { time, states, samplingTime } of history.fans[plane] ?? []) curve(time, states, samplingTime);
      ctx.globalAlpha = 0.9;
      ctx.setLineDash([3 * ratio, 3 * ratio]);
      const states = history.predictions[plane];
      if (states) curve(history.nowAt(plane, NOW.time), states, history.samplingTime);
    }
  });
}

/** A line at a time. */
export function drawTime(chart: uPlot, time: number, colour: string): void {
  const { ctx, bbox } = chart;
  clipped(chart, () => {
    // The chart's last curve leaves its dashes.
    ctx.setLineDash([]);
    ctx.globalAlpha = 0.5;
    ctx.strokeStyle = colour;
    ctx.lineWidth = uPlot.pxRatio;
    const at = Math.round(chart.valToPos(time, "x", true)) + 0.5;
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
  });
}
