// The strip charts: one quantity per strip, one time axis for all.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { ROW } from "../protocol";
import type { Scenario } from "../scenario";
import { medianStep } from "../status";
import { columns, planeOf, type Shown } from "./columns";
import { drawNow, drawPredictions, shadeBounds } from "./marks";
import { STRIPS, type Strip } from "./strips";

/** At most three powers of ten, evenly spaced. */
function decades(low: number, high: number): number[] {
  const [from, to] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
  const step = Math.max(Math.ceil((to - from) / 3), 1);
  const made: number[] = [];
  for (let exponent = from; exponent <= to; exponent += step) made.push(10 ** exponent);
  return made;
}

/** Shown at once, s. */
const WINDOW = 8;
const AXIS_WIDTH = 52;
/** In place of a value that there is not: a recording does not hold the motors' torques. */
const UNKNOWN = "\u2013";

interface Colours {
  ink: string;
  faint: string;
  reference: string;
  outside: string;
  surface: string;
}

export class Plots {
  private readonly charts: uPlot[] = [];
  private shown: Shown[] = [];
  private bounds: Scenario["bounds"] | undefined;
  private plane = 0;
  private time = 0;
  private colours: Colours = this.readColours();

  constructor(private readonly host: HTMLElement) {}

  private readColours(): Colours {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    return {
      ink: colour("--ink"),
      faint: colour("--rule"),
      reference: colour("--reference"),
      outside: colour("--outside"),
      surface: colour("--surface"),
    };
  }

  /** Starts afresh with these robots. */
  setRobots(shown: Shown[], bounds: Scenario["bounds"]): void {
    this.shown = shown;
    this.bounds = bounds;
    this.colours = this.readColours();
    for (const chart of this.charts.splice(0)) chart.destroy();
    this.host.replaceChildren();
    for (const [index, strip] of STRIPS.entries()) {
      const figure = document.createElement("figure");
      figure.className = "strip";
      const caption = document.createElement("figcaption");
      caption.textContent = strip.unit ? `${strip.title} [${strip.unit}]` : strip.title;
      const value = document.createElement("span");
      caption.append(value);
      const plot = document.createElement("div");
      plot.setAttribute("role", "img");
      plot.setAttribute("aria-label", `${strip.title} over time; the number beside the title is its value now`);
      figure.append(caption, plot);
      this.host.append(figure);
      this.charts.push(new uPlot(this.options(strip, index, plot), [[]], plot));
    }
    this.resize();
  }

  setBounds(bounds: Scenario["bounds"]): void {
    this.bounds = bounds;
  }

  setPlane(plane: number): void {
    this.plane = plane;
  }

  private options(strip: Strip, index: number, host: HTMLElement): uPlot.Options {
    const { ink, faint, reference } = this.colours;
    const last = index === STRIPS.length - 1;
    const paths = strip.held ? uPlot.paths.stepped?.({ align: 1 }) : uPlot.paths.linear?.();
    const line = (colour: string, width = 1.6, dash?: number[]): uPlot.Series => ({
      stroke: colour,
      width,
      points: { show: false },
      ...(paths ? { paths } : {}),
      ...(dash ? { dash } : {}),
    });
    const series: uPlot.Series[] = [{}];
    for (const { colour } of this.shown) {
      if (strip.motors) {
        series.push(line(colour), line(colour, 1.2, [6, 3]), line(colour, 1.2, [2, 2]));
      } else series.push(line(colour));
    }
    if (strip.reference) series.push(line(reference, 1.4, [5, 4]));
    const font = "11px system-ui, sans-serif";
    return {
      width: host.clientWidth || 300,
      height: 80,
      padding: [4, 8, last ? 0 : 4, 0],
      legend: { show: false },
      cursor: { drag: { setScale: false, x: false, y: false }, sync: { key: "strips" }, y: false, points: { show: false } },
      series,
      scales: {
        x: { time: false, range: () => this.timeRange() },
        y: { distr: strip.logarithmic ? 3 : 1, range: (_, low, high) => this.valueRange(strip, low, high) },
      },
      axes: [
        { show: true, size: last ? 24 : 0, stroke: ink, font, grid: { stroke: faint, width: 1 }, ticks: { show: false }, ...(last ? {} : { values: () => [] }) },
        {
          size: AXIS_WIDTH, stroke: ink, font, grid: { stroke: faint, width: 1 }, ticks: { show: false }, space: 26,
          ...(strip.logarithmic ? { splits: (_chart: uPlot, _axis: number, low: number, high: number) => decades(low, high), filter: (_chart: uPlot, splits: number[]) => splits, values: (_chart: uPlot, splits: number[]) => splits.map((value) => value.toExponential(0).replace("e+", "e")) } : {}),
        },
      ],
      hooks: {
        drawClear: [(chart) => shadeBounds(chart, this.bounds && strip.bound?.(this.bounds), this.colours.outside)],
        draw: [(chart) => this.drawOver(chart, strip)],
      },
    };
  }

  private timeRange(): [number, number] {
    const reach = Math.max(...this.shown.map(({ history: h }) => ((h.predictions[0]?.length ?? 0) / 4) * h.samplingTime), 0);
    const ahead = Math.min(reach, WINDOW / 3);
    const end = Math.max(this.time, WINDOW - ahead) + ahead;
    return [end - WINDOW, end];
  }

  private valueRange(strip: Strip, low: number | null, high: number | null): [number, number] {
    let [from, to] = [low ?? 0, high ?? 0];
    if (strip.logarithmic) {
      from = Math.max(from, 1e-6);
      to = Math.max(to, from * 10);
      return [10 ** Math.floor(Math.log10(from)), 10 ** Math.ceil(Math.log10(to))];
    }
    for (const value of this.predictedExtremes(strip)) {
      from = Math.min(from, value);
      to = Math.max(to, value);
    }
    // A rare long step, when the machine was busy, may leave the strip.
    if (strip.column === ROW.stepMicroseconds) to = Math.min(to, 4 * this.usualStep());
    if (strip.fromZero) return [0, Math.max(to * 1.1, strip.least)];
    const middle = (from + to) / 2;
    const half = Math.max(((to - from) / 2) * 1.1, strip.least);
    return [middle - half, middle + half];
  }

  private predictedExtremes(strip: Strip): number[] {
    const component = strip.predicted;
    if (component === undefined) return [];
    return this.shown.flatMap(({ history }) => {
      const states = history.predictions[planeOf(history, this.plane)];
      if (!states) return [];
      const values = Array.from({ length: states.length / 4 }, (_, i) => states[4 * i + component] ?? 0);
      return [Math.min(...values), Math.max(...values)].filter(Number.isFinite);
    });
  }

  private usualStep(): number {
    return Math.max(...this.shown.map(({ history }) => medianStep(history)).filter(Number.isFinite), 1);
  }

  /** The plans, and a line where now is. */
  private drawOver(chart: uPlot, strip: Strip): void {
    if (strip.predicted !== undefined) drawPredictions(chart, strip.predicted, this.shown, this.plane);
    drawNow(chart, this.time, this.colours.ink);
  }

  resize(): void {
    const strips = this.host.querySelectorAll<HTMLElement>(".strip > div");
    for (const [i, chart] of this.charts.entries()) {
      const host = strips[i];
      if (host && host.clientWidth > 0) {
        chart.setSize({ width: host.clientWidth, height: Math.max(host.clientHeight, 48) });
      }
    }
  }

  /** Shows everything up to `time`, s. */
  draw(time: number): void {
    this.time = time;
    const values = this.host.querySelectorAll("figcaption > span");
    for (const [index, strip] of STRIPS.entries()) {
      const chart = this.charts[index];
      if (!chart) continue;
      chart.setData(columns(strip, this.shown, this.plane, this.timeRange()[0]), true);
      const value = values[index];
      if (value) value.textContent = this.valueNow(strip);
    }
  }

  private valueNow(strip: Strip): string {
    const history = this.shown[0]?.history;
    if (!history || history.length === 0) return "";
    const last = history.length - 1;
    if (strip.motors) {
      const torques = [0, 1, 2].map((i) => history.motor(last, i));
      return torques.every(Number.isFinite) ? torques.map((torque) => torque.toFixed(2)).join("  ") : UNKNOWN;
    }
    const value = history.at(last, planeOf(history, this.plane), strip.column ?? 0);
    if (!Number.isFinite(value)) return UNKNOWN;
    return strip.fromZero ? value.toFixed(0) : strip.logarithmic ? value.toPrecision(3) : value.toFixed(3);
  }
}
