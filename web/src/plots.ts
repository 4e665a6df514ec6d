// The strip charts: one quantity per strip, one time axis for all.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { History } from "./history";
import { ROW } from "./protocol";
import type { Range, Scenario } from "./scenario";
import { medianStep } from "./status";

/** At most three powers of ten, evenly spaced. */
function decades(low: number, high: number): number[] {
  const [from, to] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
  const step = Math.max(Math.ceil((to - from) / 3), 1);
  const made: number[] = [];
  for (let exponent = from; exponent <= to; exponent += step) made.push(10 ** exponent);
  return made;
}

/** What a strip shows. */
interface Strip {
  title: string;
  unit: string;
  /** Column of the sample, or a motor by its number. */
  column?: number;
  motors?: boolean;
  /** Component of the predicted state. */
  predicted?: number;
  bound?: (bounds: Scenario["bounds"]) => Range;
  /** Held from each sample to the next. */
  held?: boolean;
  logarithmic?: boolean;
  /** The smallest half-height of the scale, so that noise does not fill the strip. */
  least: number;
  fromZero?: boolean;
  reference?: boolean;
}

const STRIPS: Strip[] = [
  { title: "phi", unit: "rad", column: ROW.phi, predicted: 0, bound: (b) => b.phi_rad, least: 0.5, reference: true },
  { title: "theta", unit: "rad", column: ROW.theta, predicted: 1, bound: (b) => b.theta_rad, least: 0.05 },
  { title: "phi_dot", unit: "rad/s", column: ROW.phiDot, predicted: 2, bound: (b) => b.phi_dot_rad_s, least: 1 },
  { title: "theta_dot", unit: "rad/s", column: ROW.thetaDot, predicted: 3, bound: (b) => b.theta_dot_rad_s, least: 0.2 },
  { title: "torque", unit: "N m", column: ROW.torque, bound: (b) => b.torque_nm, held: true, least: 0.05 },
  { title: "motor torques", unit: "N m", motors: true, held: true, least: 0.05 },
  { title: "cost J", unit: "", column: ROW.cost, held: true, logarithmic: true, least: 1 },
  { title: "active bounds", unit: "", column: ROW.activeBounds, held: true, least: 2, fromZero: true },
  { title: "time per step", unit: "\u00b5s", column: ROW.stepMicroseconds, held: true, least: 20, fromZero: true },
];

/** Shown at once, s. */
const WINDOW = 8;
/** Points of a curve; more would not be seen. */
const MOST_POINTS = 900;
const AXIS_WIDTH = 52;

export interface Shown {
  history: History;
  colour: string;
}

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
      const value = document.createElement("output");
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
        drawClear: [(chart) => this.shadeBounds(chart, strip)],
        draw: [(chart) => this.drawPredictions(chart, strip)],
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
      const states = history.predictions[this.planeOf(history)];
      if (!states) return [];
      const values = Array.from({ length: states.length / 4 }, (_, i) => states[4 * i + component] ?? 0);
      return [Math.min(...values), Math.max(...values)].filter(Number.isFinite);
    });
  }

  private usualStep(): number {
    return Math.max(...this.shown.map(({ history }) => medianStep(history)).filter(Number.isFinite), 1);
  }

  private planeOf(history: History): number {
    return Math.min(this.plane, history.planes - 1);
  }

  private shadeBounds(chart: uPlot, strip: Strip): void {
    const bounds = this.bounds && strip.bound?.(this.bounds);
    if (!bounds) return;
    const { ctx, bbox } = chart;
    const edge = (value: number) =>
      Math.min(Math.max(chart.valToPos(value, "y", true), bbox.top), bbox.top + bbox.height);
    const [top, bottom] = [edge(bounds[1]), edge(bounds[0])];
    ctx.save();
    ctx.fillStyle = this.colours.outside;
    if (Number.isFinite(bounds[1])) ctx.fillRect(bbox.left, bbox.top, bbox.width, top - bbox.top);
    if (Number.isFinite(bounds[0])) ctx.fillRect(bbox.left, bottom, bbox.width, bbox.top + bbox.height - bottom);
    ctx.restore();
  }

  /** The plan ahead, and earlier plans behind what then happened. */
  private drawPredictions(chart: uPlot, strip: Strip): void {
    const component = strip.predicted;
    const { ctx, bbox } = chart;
    const ratio = uPlot.pxRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    if (component !== undefined) {
      for (const { history, colour } of this.shown) {
        const plane = this.planeOf(history);
        ctx.strokeStyle = colour;
        ctx.lineWidth = ratio;
        const curve = (time: number, states: Float64Array) => {
          ctx.beginPath();
          for (let i = 0; 4 * i < states.length; i++) {
            const x = chart.valToPos(time + i * history.samplingTime, "x", true);
            ctx.lineTo(x, chart.valToPos(states[4 * i + component] ?? 0, "y", true));
          }
          ctx.stroke();
        };
        ctx.globalAlpha = 0.35;
        for (const { time, states } of history.fans[plane] ?? []) curve(time, states);
        ctx.globalAlpha = 0.9;
        ctx.setLineDash([3 * ratio, 3 * ratio]);
        const states = history.predictions[plane];
        if (states) curve(history.nowAt(plane, ROW.time), states);
        ctx.setLineDash([]);
      }
    }
    ctx.globalAlpha = 0.5;
    ctx.strokeStyle = this.colours.ink;
    ctx.lineWidth = ratio;
    const now = Math.round(chart.valToPos(this.time, "x", true)) + 0.5;
    ctx.beginPath();
    ctx.moveTo(now, bbox.top);
    ctx.lineTo(now, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
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
    const outputs = this.host.querySelectorAll<HTMLOutputElement>("figcaption > output");
    for (const [index, strip] of STRIPS.entries()) {
      const chart = this.charts[index];
      if (!chart) continue;
      chart.setData(this.data(strip), true);
      const output = outputs[index];
      if (output) output.textContent = this.valueNow(strip);
    }
  }

  private valueNow(strip: Strip): string {
    const history = this.shown[0]?.history;
    if (!history || history.length === 0) return "";
    const last = history.length - 1;
    if (strip.motors) return [0, 1, 2].map((i) => history.motor(last, i).toFixed(2)).join("  ");
    const value = history.at(last, this.planeOf(history), strip.column ?? 0);
    if (!Number.isFinite(value)) return "";
    return strip.fromZero ? value.toFixed(0) : strip.logarithmic ? value.toPrecision(3) : value.toFixed(3);
  }

  /** One column of times, then the columns of every robot. Robots may have stopped early. */
  private data(strip: Strip): uPlot.AlignedData {
    const longest = this.shown.map(({ history }) => history).reduce<History | undefined>(
      (most, history) => (most === undefined || history.total > most.total ? history : most), undefined);
    if (!longest || longest.length === 0) return [[], ...this.emptyColumns(strip)];
    const [start] = this.timeRange();
    const from = Math.max(longest.indexAt(start) - 1, 0);
    const stride = Math.max(Math.ceil((longest.length - from) / MOST_POINTS), 1);
    const indices: number[] = [];
    for (let i = from; i < longest.length; i += stride) indices.push(i);
    const end = longest.nowAt(0, ROW.time);
    const times = [...indices.map((i) => longest.at(i, 0, ROW.time)), end];
    const columns: (number | null)[][] = [];
    for (const { history } of this.shown) {
      const offset = longest.total - longest.length - (history.total - history.length);
      const column = (value: (i: number) => number, final: number | null) => {
        const values = indices.map((i) => {
          const at = i + offset;
          const known = at >= 0 && at < history.length ? value(at) : NaN;
          return Number.isFinite(known) ? known : null;
        });
        columns.push([...values, history === longest ? final : null]);
      };
      const plane = this.planeOf(history);
      const last = history.length - 1;
      if (strip.motors) {
        for (let motor = 0; motor < 3; motor++) column((i) => history.motor(i, motor), history.motor(last, motor));
      } else {
        const key = strip.column ?? ROW.phi;
        const final = strip.held ? history.at(last, plane, key) : history.nowAt(plane, key);
        column((i) => history.at(i, plane, key), Number.isFinite(final) ? final : null);
      }
    }
    if (strip.reference) {
      const plane = this.planeOf(longest);
      columns.push([...indices.map((i) => longest.at(i, plane, ROW.phiReference)), longest.nowAt(plane, 5)]);
    }
    return [times, ...columns] as uPlot.AlignedData;
  }

  private emptyColumns(strip: Strip): number[][] {
    const perRobot = strip.motors ? 3 : 1;
    return Array.from({ length: this.shown.length * perRobot + (strip.reference ? 1 : 0) }, () => []);
  }
}
