// What depends on the clock of the machine: these run alone, after the others.

import { readFileSync } from "node:fs";
import { availableParallelism, loadavg } from "node:os";
import { expect, type Page } from "@playwright/test";
import { median } from "../src/steptime";
import { fill, open, pause, saved, scenario, settled, table, test, until } from "./page";

/** Said of a measurement that is not as expected: a machine with more to do than it has cores cannot tell. */
function busyness(): string {
  return `load average ${loadavg()[0]?.toFixed(1)} on ${availableParallelism()} cores`;
}

test("the loop runs at one kilohertz", async ({ page }) => {
  const problems = await open(page);
  await fill(page, "Sampling t_s", "1");
  await page.locator("#play").click();
  const seen = await page.evaluate(async () => {
    const readings: [wall: number, simulated: number][] = [];
    while ((readings.at(-1)?.[1] ?? 0) < 4) {
      readings.push([performance.now() / 1000, parseFloat(document.getElementById("clock")?.textContent ?? "")]);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    return readings;
  });
  // A busy machine may hold it up now and then: in its best two seconds it runs in real time.
  const rates = seen.flatMap(([begin, from]) => seen.filter(([end]) => end - begin > 2).map(([end, to]) => (to - from) / (end - begin)));
  expect(Math.max(...rates), busyness()).toBeGreaterThan(0.9);
  await pause(page);
  const times = table(await saved(page, "Save CSV"))["t_s"] ?? [];
  expect(times.length).toBeGreaterThan(3000);
  expect((times[2001] ?? NaN) - (times[2000] ?? NaN)).toBeCloseTo(0.001, 9);
  await expect(page.locator("#alert")).toBeHidden();
  expect(problems).toEqual([]);
});

/** That the time per step that is shown is the median of the saved ones, of all planes. How long a step may take is judged beside
 *  the program's, in one run (scripts/times.mjs): the time alone depends on what else the machine does. */
async function expectMeasured(page: Page, planes: number): Promise<void> {
  const files: Promise<string>[] = [];
  page.on("download", (download) => files.push(download.path().then((path) => readFileSync(path, "utf8"))));
  await page.getByRole("button", { name: "Save CSV" }).click();
  await expect.poll(() => files.length).toBe(planes);
  const steps = (await Promise.all(files)).flatMap((csv) => table(csv)["step_us"] ?? []).filter(Number.isFinite);
  expect(steps.length).toBeGreaterThan(70);
  const middle = median(steps);
  await settled(page);
  const shown = parseFloat((await page.locator("#status .time").textContent()) ?? "");
  expect(shown).toBeCloseTo(middle, 1);
  expect(middle).toBeGreaterThan(0);
  test.info().annotations.push({ type: "median time per step", description: `${middle} us` });
}

test("the time per step that is shown is the measured one", async ({ page }) => {
  await open(page);
  await scenario(page, "two-setpoints");
  await page.locator("#play").click();
  await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
  await expectMeasured(page, 1);
});

test("and that of two planes with the default predictor", async ({ page }) => {
  await open(page);
  await fill(page, "Target X", "0.5");
  await until(page, 4);
  await pause(page);
  await expectMeasured(page, 2);
});
