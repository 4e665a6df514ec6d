// The strip charts: one quantity per strip, one time axis for all.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { ROW } from "../layout";
import type { Scenario } from "../scenario";
import { COARSE_CLOCK, usualStep } from "../steptime";
import { unitOf, type Unit, type UnitSystem } from "../units";
import { columns, planeOf, valuesAt, type Shown } from "./columns";
import { drawPredictions, drawTime, shadeBounds } from "./marks";
import { decades, ticks, valueRange } from "./range";
import { STRIPS, type Strip } from "./strips";

/** Shown at once, s. */
const WINDOW = 8;
const AXIS_WIDTH = 52;
/** Room for half a number above and below the axes, px. */
const HALF_NUMBER = 7;
/** Room for the times and their name, px. */
const TIME_AXIS = 20;
const TIME_LABEL = 15;
const FONT = "11px system-ui, sans-serif";
/** In place of a value that there is not: a recording does not hold the motors' torques. */
const UNKNOWN = "\u2013";

interface Colours {
  ink: string;
  faint: string;
  reference: string;
  outside: string;
}

/** Digits that are seen on an axis. */
function short(value: number): string {
  return String(Number(value.toPrecision(4)));
}

export class Plots {
  private readonly charts: uPlot[] = [];
  private shown: Shown[] = [];
  private bounds: Scenario["bounds"] | undefined;
  private plane = 0;
  private time = 0;
  /** The time under the pointer, s. */
  pointed: number | undefined;
  private system: UnitSystem = "metres";
  private ballRadius = 1;
  private colours: Colours = this.readColours();

  /** `pointedAt` hears of the time under the pointer, s. */
  constructor(private readonly host: HTMLElement, private readonly pointedAt: (time: number | undefined) => void) {
    host.addEventListener("pointerleave", () => this.point(undefined));
  }

  private readColours(): Colours {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    return { ink: colour("--ink"), faint: colour("--rule"), reference: colour("--reference"), outside: colour("--outside") };
  }

  /** Starts afresh with these robots. */
  setRobots(shown: Shown[], bounds: Scenario["bounds"]): void {
    this.shown = shown;
    this.bounds = bounds;
    this.pointed = undefined;
    this.colours = this.readColours();
    for (const chart of this.charts.splice(0)) chart.destroy();
    this.host.replaceChildren();
    for (const [index, strip] of STRIPS.entries()) {
      const figure = document.createElement("figure");
      figure.className = "strip";
      const caption = document.createElement("figcaption");
      caption.title = strip.meaning;
      const value = document.createElement("span");
      for (const { colour } of shown) {
        const part = value.appendChild(document.createElement("i"));
        if (shown.length > 1) part.style.color = colour;
      }
      caption.append(document.createElement("b"), value);
      const plot = document.createElement("div");
      plot.setAttribute("role", "img");
      plot.setAttribute("aria-label", `${strip.title} over time; the number beside the title is its value now. ${strip.meaning}`);
      figure.append(caption, plot);
      this.host.append(figure);
      this.charts.push(new uPlot(this.options(strip, index, plot), [[]], plot));
    }
    this.showTitles();
    this.resize();
  }

  setBounds(bounds: Scenario["bounds"]): void {
    this.bounds = bounds;
  }

  setPlane(plane: number): void {
    this.plane = plane;
  }

  setUnits(system: UnitSystem, ballRadius: number): void {
    [this.system, this.ballRadius] = [system, ballRadius];
    this.showTitles();
  }

  private unit(strip: Strip): Unit {
    return strip.quantity ? unitOf(strip.quantity, this.system, this.ballRadius) : { name: strip.unit, factor: 1 };
  }

  private showTitles(): void {
    for (const [index, title] of this.host.querySelectorAll("figcaption > b").entries()) {
      const strip = STRIPS[index];
      if (!strip) continue;
      const { name } = this.unit(strip);
      const mean = COARSE_CLOCK && strip.column === ROW.stepMicroseconds ? " (mean)" : "";
      const words = (this.system === "metres" && strip.inMetres) || strip.title;
      title.textContent = `${words}${mean}${name === "" ? "" : ` [${name}]`}`;
    }
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
    const axis: uPlot.Axis = { stroke: ink, font: FONT, grid: { stroke: faint, width: 1 }, ticks: { show: false } };
    const times: uPlot.Axis = last
      ? { ...axis, size: TIME_AXIS, gap: 2, label: "time [s]", labelSize: TIME_LABEL, labelFont: FONT, labelGap: 0 }
      : { ...axis, size: 0, values: () => [] };
    return {
      width: host.clientWidth || 300,
      height: 80,
      padding: [HALF_NUMBER, 8, last ? 0 : HALF_NUMBER, 0],
      legend: { show: false },
      cursor: { drag: { setScale: false, x: false, y: false }, sync: { key: "strips" }, y: false, points: { show: false } },
      series,
      scales: {
        x: { time: false, range: () => this.timeRange() },
        y: { distr: strip.logarithmic ? 3 : 1, range: (_, low, high) => this.valueRange(strip, low, high) },
      },
      axes: [times, {
        ...axis, size: AXIS_WIDTH, gap: 4,
        splits: (chart, _axis, low, high) => this.splits(chart, strip, low, high),
        filter: (_chart, splits) => splits,
        values: (_chart, splits) => splits.map((value) =>
          strip.logarithmic ? value.toExponential(0).replace("e+", "e") : short(value / this.unit(strip).factor)),
      }],
      hooks: {
        drawClear: [(chart) => shadeBounds(chart, this.bounds && strip.bound?.(this.bounds), this.colours.outside)],
        draw: [(chart) => this.drawOver(chart, strip)],
        setCursor: [(chart) => {
          const { left } = chart.cursor;
          this.point(left !== undefined && left >= 0 ? chart.posToVal(left, "x") : undefined);
        }],
      },
    };
  }

  private splits(chart: uPlot, strip: Strip, low: number, high: number): number[] {
    if (strip.logarithmic) return decades(low, high);
    const { factor } = this.unit(strip);
    return ticks(low / factor, high / factor, chart.bbox.height / uPlot.pxRatio).map((value) => value * factor);
  }

  private timeRange(): [number, number] {
    const reach = Math.max(...this.shown.map(({ history: h }) => ((h.predictions[0]?.length ?? 0) / 4) * h.samplingTime), 0);
    const ahead = Math.min(reach, WINDOW / 3);
    const end = Math.max(this.time, WINDOW - ahead) + ahead;
    return [end - WINDOW, end];
  }

  private valueRange(strip: Strip, low: number | null, high: number | null): [number, number] {
    // A rare long step, when the machine was busy, may leave the strip.
    const isStep = strip.column === ROW.stepMicroseconds;
    const most = isStep && high !== null ? Math.min(high, 4 * this.usualStep()) : high;
    return valueRange(strip, [low, most], this.planned(strip), this.bounds && strip.bound?.(this.bounds));
  }

  /** The values of a strip that the plans lead through. */
  private planned(strip: Strip): number[] {
    const component = strip.predicted;
    if (component === undefined) return [];
    return this.shown.flatMap(({ history }) => {
      const states = history.predictions[planeOf(history, this.plane)] ?? [];
      return Array.from({ length: states.length / 4 }, (_, i) => states[4 * i + component] ?? NaN);
    });
  }

  private usualStep(): number {
    return Math.max(...this.shown.map(({ history }) => usualStep(history)).filter(Number.isFinite), 1);
  }

  /** The plans, and a line at the time that the scene shows. */
  private drawOver(chart: uPlot, strip: Strip): void {
    if (strip.predicted !== undefined) drawPredictions(chart, strip.predicted, this.shown, this.plane);
    drawTime(chart, this.time, this.colours.ink);
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

  /** Shows the run, and `time`, s, in it. */
  draw(time: number): void {
    this.time = time;
    for (const [index, strip] of STRIPS.entries()) {
      this.charts[index]?.setData(columns(strip, this.shown, this.plane, this.timeRange()), true);
    }
    this.showValues();
  }

  private point(time: number | undefined): void {
    if (time === this.pointed) return;
    this.pointed = time;
    this.showValues();
    this.pointedAt(time);
  }

  /** The values at the time under the pointer, or at the time shown: of every robot, in its colour. */
  private showValues(): void {
    const time = this.pointed ?? this.time;
    for (const [index, value] of this.host.querySelectorAll("figcaption > span").entries()) {
      const strip = STRIPS[index];
      if (!strip) continue;
      for (const [i, { history }] of this.shown.entries()) {
        const part = value.children[i];
        const text = this.valueAt(strip, history, time);
        if (part && part.textContent !== text) part.textContent = text;
      }
    }
  }

  /** The value of the last sample up to a time. */
  private valueAt(strip: Strip, history: Shown["history"], time: number): string {
    const index = Math.min(history.indexAt(time + 1e-9), history.length) - 1;
    if (history.length === 0) return "";
    const values = valuesAt(strip, history, Math.max(index, 0), planeOf(history, this.plane));
    if (!values.every(Number.isFinite)) return UNKNOWN;
    const { factor } = this.unit(strip);
    const digits = strip.motors ? 2 : 3;
    const words = (value: number) => (strip.fromZero ? value.toFixed(0) : strip.logarithmic ? value.toPrecision(3) : value.toFixed(digits));
    // What rounds to nothing has no sign.
    return values.map((value) => words(value / factor).replace(/^-(?=[0.]*$)/, "")).join("  ");
  }
}
