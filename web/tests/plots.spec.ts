// What the charts make of numbers, whatever a plan holds; and what they tell a person.

import { expect } from "@playwright/test";
import { History } from "../src/history";
import { predictedPoses } from "../src/motion";
import { goalOf } from "../src/pictures";
import { columns } from "../src/plots/columns";
import { drawPredictions, drawTime } from "../src/plots/marks";
import { ticks, valueRange } from "../src/plots/range";
import { STRIPS, type Strip } from "../src/plots/strips";
import { ROW, ROW_WIDTH } from "../src/layout";
import { clock, fill, open, openFlat, pause, saved, scenario, table, test, until } from "./page";

/** The strip of phi, of theta and so on. */
function strip(title: string): Strip {
  const found = STRIPS.find((candidate) => candidate.title.startsWith(title));
  if (!found) throw new Error(`no strip ${title}`);
  return found;
}

/** A robot at rest, with a plan. */
function planning(states: number[], samplingTime = 0.05): History {
  const history = new History(1, samplingTime, 0.4);
  history.add({
    rows: new Float64Array(ROW_WIDTH), motors: new Float64Array(3), statuses: [], now: Float64Array.from([0.05, 0, 0, 0, 0, 0]),
    prediction: [Float64Array.from(states)], activeBounds: [""], down: false,
  });
  return history;
}

test("a value that is not finite does not empty the range, and a huge one does not flatten it", () => {
  const theta = strip("theta:");
  const bounds: [number, number] = [-1, 1];
  expect(valueRange(theta, [-0.2, 0.3], [NaN, 0.4, Infinity, -Infinity], bounds)).toEqual(valueRange(theta, [-0.2, 0.3], [0.4], bounds));
  const [low, high] = valueRange(theta, [-0.2, 0.3], [0.4, 1e30, -1e30], bounds);
  expect(high - low).toBeLessThan(20);
  expect(high - low).toBeGreaterThan(1);
  expect(valueRange(theta, [null, null], [NaN], undefined).every(Number.isFinite)).toBe(true);
  expect(valueRange(theta, [NaN, Infinity], [], undefined).every(Number.isFinite)).toBe(true);
});

test("an axis has at least two numbers, and none of them touch", () => {
  for (const pixels of [30, 34, 60, 200]) {
    for (const [low, high] of [[-0.055, 0.055], [-1.1, 1.1], [0, 2], [-0.2, 2.7], [-31.4, 28], [999.9, 1000.1], [0, 3.3e-7]] as const) {
      const made = ticks(low, high, pixels);
      const text = `${low} to ${high} on ${pixels} px: ${made}`;
      expect(made.length, text).toBeGreaterThanOrEqual(2);
      const gaps = made.slice(1).map((value, i) => ((value - (made[i] ?? NaN)) / (high - low)) * pixels);
      expect(Math.min(...gaps), text).toBeGreaterThan(11);
      expect(made.every((value) => value >= low - 1e-9 * (high - low) && value <= high + 1e-9 * (high - low)), text).toBe(true);
    }
  }
  expect(ticks(0, 0, 50)).toEqual([]);
  expect(ticks(NaN, 1, 50)).toEqual([]);
});

/** A chart that notes what is drawn into it. */
function noting() {
  const points: [number, number][] = [];
  let dash: number[] = [6, 3];
  const strokes: number[][] = [];
  const ctx = {
    save() {}, restore() {}, beginPath() {}, rect() {}, clip() {}, setLineDash(made: number[]) { dash = made; },
    moveTo(x: number, y: number) { points.push([x, y]); }, lineTo(x: number, y: number) { points.push([x, y]); },
    stroke() { strokes.push(dash); },
  };
  const chart = {
    ctx, bbox: { left: 50, top: 10, width: 400, height: 100 },
    // 50 px per second, 100 px per rad.
    valToPos: (value: number, scale: string) => (scale === "x" ? 50 + 50 * value : 60 - 100 * value),
  };
  return { chart: chart as never, points, strokes };
}

test("a plan beyond all bounds is drawn no further than just outside the axes", () => {
  // A long plan whose tilt grows without end, over two seconds and then for hours.
  for (const step of [0.05, 100]) {
    const states = Array.from({ length: 200 }, (_, i) => [0, (-10) ** (i / 4), 0, 0]).flat();
    const history = planning(states, step);
    const { chart, points } = noting();
    drawPredictions(chart, 1, [{ history, colour: "red" }], 0);
    expect(points.length).toBeGreaterThan(0);
    for (const [x, y] of points) {
      expect(Number.isFinite(x + y)).toBe(true);
      expect(Math.abs(x)).toBeLessThan(1000);
      expect(Math.abs(y)).toBeLessThan(1000);
    }
  }
});

test("an earlier plan stays where it was when the sampling time changes", () => {
  const history = planning([0, 0, 0, 0, 0, 0, 0, 0]);
  const ofEarlier = () => {
    const { chart, points } = noting();
    drawPredictions(chart, 1, [{ history, colour: "red" }], 0);
    return points.slice(0, 2).map(([x]) => x);
  };
  // From the end of its first sample on.
  expect(ofEarlier()).toEqual([52.5, 55]);
  history.samplingTime = 0.5;
  expect(ofEarlier()).toEqual([52.5, 55]);
});

test("what is not a number ends a plan, and leaves a gap in a curve", () => {
  const states = [0, 0.1, 0, 0, 0, 0.2, 0, 0, NaN, NaN, NaN, NaN, 0, 0.1, 0, 0];
  const { chart, points } = noting();
  drawPredictions(chart, 1, [{ history: planning(states), colour: "red" }], 0);
  // Now, and as the first of the earlier plans.
  expect(points.length).toBe(4);
  expect(predictedPoses(planning(states), 0.12).length).toBe(2);
  expect(predictedPoses(planning([0, 0, 0, 0, 1e30, 0, 0, 0]), 0.12).length).toBe(1);
  const history = planning([]);
  history.add({
    rows: new Float64Array(ROW_WIDTH).fill(NaN).map((value, i) => (i === 0 ? 0.05 : value)), motors: new Float64Array(3), statuses: [],
    now: Float64Array.from([0.1, 0, 0, 0, 0, Infinity]), prediction: [], activeBounds: [""], down: false,
  });
  const [, ...curves] = columns(strip("phi:"), [{ history, colour: "red" }], 0, [0, 8]);
  expect(curves).toEqual([[0, null, 0], [0, null, null]]);
});

test("a short window of a long run is drawn sample by sample, and no further", () => {
  const history = new History(1, 0.01, 1000);
  const rows = new Float64Array(20_000 * ROW_WIDTH).map((_, i) => (i % ROW_WIDTH === ROW.time ? Math.floor(i / ROW_WIDTH) / 100 : 0));
  history.add({ rows, motors: new Float64Array(60_000), statuses: [], now: Float64Array.from([200, 0, 0, 0, 0, 0]), prediction: [], activeBounds: [""], down: false });
  const times = (window: [number, number]) => [...columns(strip("phi:"), [{ history, colour: "red" }], 0, window)[0]];
  expect(times([1, 9])).toEqual(Array.from({ length: 802 }, (_, i) => (99 + i) / 100));
  expect(times([193, 201]).at(-1)).toBe(200);
});

test("the line at the present has no dashes", () => {
  const { chart, strokes } = noting();
  drawTime(chart, 1, "black");
  expect(strokes).toEqual([[]]);
});

/** The numbers beside the titles of the charts. */
async function values(page: import("@playwright/test").Page): Promise<number[]> {
  return (await page.locator("#plots figcaption > span").allTextContents()).map(parseFloat);
}

test("the values under the pointer are shown, and the time there", async ({ page }) => {
  await openFlat(page);
  await fill(page, "Target X", "0.5");
  await until(page, 3);
  await pause(page);
  expect((await values(page))[0]).toBeCloseTo(0.5, 1);
  const csv = table(await saved(page, "Save CSV"));
  const plot = await page.locator("#plots .u-over").first().boundingBox();
  if (!plot) throw new Error("no plot");
  // The window has eight seconds, and ends with the plan, a second ahead. Between two samples.
  const begin = Math.max((csv["t_s"]?.at(-1) ?? NaN) + 1 - 8, 0);
  const wanted = Math.ceil(begin / 0.05) * 0.05 + 0.625;
  await page.mouse.move(plot.x + plot.width * ((wanted - begin) / 8), plot.y + plot.height / 2);
  await expect(page.locator("#reviewed")).toHaveText(/at the pointer: \d/);
  const at = parseFloat(((await page.locator("#reviewed").textContent()) ?? "").replace(/\D*/, ""));
  expect(Math.abs(at - wanted)).toBeLessThan(0.02);
  const row = (csv["t_s"] ?? []).findLastIndex((time) => time <= at);
  expect((await values(page))[0]).toBeCloseTo(0.12 * (csv["phi_rad"]?.[row] ?? NaN), 3);
  await page.mouse.move(5, 5);
  await expect(page.locator("#reviewed")).toHaveText("");
});

test("a run can be looked back at while it does not run", async ({ page }) => {
  await open(page);
  const slider = page.getByRole("slider", { name: "Look back" });
  await expect(slider).toBeDisabled();
  await fill(page, "Target X", "0.5");
  await until(page, 3);
  await expect(slider).toBeDisabled();
  await pause(page);
  const end = await clock(page);
  await expect(slider).toBeEnabled();
  await slider.fill("0.5");
  await expect(page.locator("#clock")).toHaveText("0.50 s");
  expect((await values(page))[1]).toBeLessThan(-5);
  await slider.fill("0");
  await expect(page.locator("#clock")).toHaveText("0.00 s");
  expect((await values(page))[0]).toBeCloseTo(0, 6);
  // What follows is what would have followed.
  const before = table(await saved(page, "Save CSV"))["t_s"]?.length ?? NaN;
  // A path that is drawn meanwhile begins where the robot stands, not where it is seen.
  await page.getByText("Draw path").click();
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  await page.mouse.move(box.x + box.width * 0.3, box.y + box.height * 0.85);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.4, box.y + box.height * 0.85, { steps: 4 });
  await page.mouse.up();
  await until(page, end + 0.2);
  const run = table(await saved(page, "Save CSV"));
  const first = run["t_s"]?.findIndex((time) => time >= end - 0.05) ?? -1;
  expect(first).toBeGreaterThan(0);
  for (const reference of run["phi_ref_rad"]?.slice(first, first + 3) ?? []) expect(Math.abs(0.12 * reference - 0.5)).toBeLessThan(0.2);
  await pause(page);
  const later = await clock(page);
  await slider.fill("0");
  await page.locator("#play").click();
  await until(page, later + 0.2);
  expect(table(await saved(page, "Save CSV"))["t_s"]?.length).toBeGreaterThan(before);
});

test("looked back at, the target is that of then", () => {
  const history = new History(1, 0.05, 0.4);
  const rows = new Float64Array(2 * ROW_WIDTH);
  [rows[ROW_WIDTH + ROW.time], rows[ROW_WIDTH + ROW.phiReference]] = [0.05, 10];
  history.add({ rows, motors: new Float64Array(6), statuses: [], now: Float64Array.from([0.1, 0, 0, 0, 0, 20]), prediction: [], activeBounds: [], down: false });
  const goals = [0, 0.04, 0.05, 0.09, 0.1, undefined].map((past) => goalOf(history, past, 0.1));
  expect(goals.map(({ x }) => x)).toEqual([0, 0, 1, 1, 2, 2]);
});

test("fields and plots are in metres and degrees, or in rad", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  const before = await saved(page, "Save TOML");
  const panel = page.locator(".panel");
  const theta = page.getByLabel("theta, upper bound");
  await page.locator("summary", { hasText: "Bounds" }).click();
  await expect(theta).toHaveValue("60");
  await expect(page.locator("#plots")).toContainText("r phi: position of the ball [m]");
  await expect(page.locator("#plots")).toContainText("theta: tilt of the body [deg]");
  await panel.getByLabel("Units", { exact: true }).selectOption("radians");
  await expect(theta).toHaveValue("1.0472");
  await expect(page.locator("#plots")).toContainText("phi: angle of the ball [rad]");
  await expect(page.locator("#plots")).toContainText("theta: tilt of the body [rad]");
  // The set-up has not changed; what is typed is in the unit that is shown.
  expect(await saved(page, "Save TOML")).toBe(before);
  await fill(page, "Target X", "2");
  await until(page, 3);
  expect((await values(page))[0]).toBeCloseTo(2, 1);
  await fill(page, "Target X", "1.005");
  await expect(panel.getByLabel("Target X", { exact: true })).toHaveValue("1.005");
  await fill(page, "Target X", "2");
  await panel.getByLabel("Units", { exact: true }).selectOption("metres");
  await expect(panel.getByLabel("Target X", { exact: true })).toHaveValue("0.24");
  await theta.fill("45");
  await theta.press("Enter");
  expect(await saved(page, "Save TOML")).toMatch(/theta_rad = \[-1\.047\d*, 0\.785398\d*\]/);
  // The choice is that of the next visit.
  await panel.getByLabel("Units", { exact: true }).selectOption("radians");
  await page.reload();
  await expect(panel.getByLabel("Units", { exact: true })).toHaveValue("radians");
});

test("the time axis has a name, and small strips have numbers", async ({ page }) => {
  await page.addInitScript(() => {
    // What is written into the charts, chart by chart.
    const write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (text: string, x: number, y: number) {
      if (this.canvas.closest(".strip")) (this.canvas.dataset["texts"] = `${this.canvas.dataset["texts"] ?? ""}|${text}`);
      return write.call(this, text, x, y);
    };
  });
  await openFlat(page);
  await fill(page, "Target X", "0.5");
  await until(page, 1);
  const texts = await page.locator("#plots .strip canvas").evaluateAll((all) => all.map((canvas) => (canvas as HTMLElement).dataset["texts"] ?? ""));
  expect(texts.at(-1)).toContain("time [s]");
  for (const text of texts) expect(new Set(text.split("|").filter((word) => word !== "")).size, text).toBeGreaterThanOrEqual(2);
});
