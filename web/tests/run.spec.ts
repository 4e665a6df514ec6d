// The runs: the numbers are those of the program, and a person can take part.

import { readFileSync } from "node:fs";
import { expect } from "@playwright/test";
import { atOnce, clock, fill, largest, open, openFile, openFlat, openSection, pass, pause, saved, scenario, setPush, settled, table, test, until, type Table } from "./page";
import { expectSame, simulated } from "./program";

for (const name of ["two-setpoints", "tight-bounds", "single-setpoint-terminal"]) {
  test(`${name} is the same run as in the program`, async ({ page }) => {
    const problems = await openFlat(page);
    await scenario(page, name);
    await page.locator("#play").click();
    await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
    const csv = await saved(page, "Save CSV");
    const toml = await saved(page, "Save TOML");
    expectSame(csv, simulated(toml)("trajectory.csv"));
    expect(problems).toEqual([]);
  });
}

test("a saved set-up with noise, delay and slope runs the same in the program", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  await openSection(page, "World");
  await fill(page, "Slope x", "1");
  await fill(page, "Noise, rates", "1.1");
  await fill(page, "Delay", "5");
  await fill(page, "b3 factor", "1.05");
  await page.locator("#play").click();
  await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
  const csv = await saved(page, "Save CSV");
  expectSame(csv, simulated(await saved(page, "Save TOML"))("trajectory.csv"));
});

test("run, pause, step, slow motion and reset", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  await page.locator("#step").click();
  await page.locator("#step").click();
  await expect(page.locator("#clock")).toHaveText("0.10 s");
  // Slowly: a busy machine must not come to the end of the scenario before the next click.
  await page.locator("#speed").selectOption("0.1");
  await page.locator("#play").click();
  await until(page, 0.2);
  await pause(page);
  const paused = await clock(page);
  await page.waitForTimeout(400);
  expect(await clock(page)).toBe(paused);
  const begun = Date.now();
  await page.locator("#play").click();
  await until(page, paused + 0.1);
  // At a tenth of real time; the clock shows hundredths.
  expect(Date.now() - begun).toBeGreaterThan(900);
  await page.locator("#reset").click();
  await expect(page.locator("#clock")).toHaveText("0.00 s");
});

test("what is pressed right after a choice is for what was chosen", async ({ page }) => {
  await openFlat(page);
  const clockAndPlay = () => Promise.all([clock(page), page.locator("#play").textContent()]);
  await atOnce(page, [["Scenario", "tight-bounds"], ["#step"], ["#step"]]);
  await expect.poll(clockAndPlay).toEqual([0.1, "Run"]);
  await atOnce(page, [["Scenario", "two-setpoints"], ["#play"]]);
  await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
  await expect(page.locator("#title")).toContainText("Two set points, LPV MPC");
  expect(table(await saved(page, "Save CSV"))["t_s"]?.length).toBe(81);
  await atOnce(page, [["Scenario", "lissajous"], ["#play"], ["#play"], ["#play"]]);
  await until(page, 0.2);
  await expect(page.locator("#play")).toHaveText("Pause");
  // It runs, and the button says so: what is pressed now stops.
  await atOnce(page, [["Scenario", "tight-bounds"], ["#play"]]);
  await expect(page.locator("#title")).toContainText("tight bounds");
  await expect.poll(clockAndPlay).toEqual([0, "Run"]);
  // Between two presses there may be time for the first sample, but for no more than a busy machine
  // catches up at once.
  await atOnce(page, [["#play"], ["#play"]]);
  await settled(page);
  const stopped = await clock(page);
  expect(stopped).toBeLessThanOrEqual(0.1);
  await page.waitForTimeout(400);
  expect(await clockAndPlay()).toEqual([stopped, "Run"]);
});

test("simulated time begins when Run is pressed, also where the control loop was held up before", async ({ page }) => {
  await openFlat(page);
  const [worker] = page.workers();
  if (!worker) throw new Error("no worker");
  const held = worker.evaluate(() => {
    for (const end = performance.now() + 90; performance.now() < end;);
  });
  // Pressed while it is held up.
  const ahead = await page.evaluate(async () => {
    const now = () => parseFloat(document.getElementById("clock")?.textContent ?? "");
    document.getElementById("play")?.click();
    const begun = performance.now();
    let most = -Infinity;
    while (now() < 0.5) {
      most = Math.max(most, now() - (performance.now() - begun) / 1000);
      await new Promise((resolve) => setTimeout(resolve, 1));
    }
    return most;
  });
  await held;
  // The clock shows hundredths.
  expect(ahead).toBeLessThan(0.006);
});

test("Pause is the last word, also after a push that waits for a change", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await until(page, 0.2);
  await page.evaluate(() => {
    const scene = document.getElementById("scene");
    const press = (key: string, shiftKey = false) => scene?.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey, bubbles: true }));
    const field = document.querySelector<HTMLInputElement>("[aria-label='Horizon N, slider']");
    field?.stepUp();
    for (const kind of ["input", "change"]) field?.dispatchEvent(new Event(kind, { bubbles: true }));
    press("ArrowRight", true);
    press(" ");
  });
  await settled(page);
  await expect(page.locator("#play")).toHaveText("Run");
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("21");
  const paused = await clock(page);
  await page.waitForTimeout(400);
  expect(await clock(page)).toBe(paused);
});

test("a target that was given right before saving stands in the file", async ({ page }) => {
  await openFlat(page);
  const download = page.waitForEvent("download");
  await page.evaluate(() => {
    const scene = document.getElementById("scene");
    scene?.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    [...document.querySelectorAll("button")].find(({ textContent }) => textContent === "Save TOML")?.click();
  });
  expect(readFileSync(await (await download).path(), "utf8")).toContain(`phi_rad = ${0.25 / 0.12}`);
});

test("a run that was ordered between two changes goes on with the second", async ({ page }) => {
  await openFlat(page);
  await atOnce(page, [["R", "500"], ["#play"], ["Horizon N", "25"]]);
  await until(page, 0.2);
  await expect(page.locator("#play")).toHaveText("Pause");
  // A step stops it, and the button says so at once: what is pressed next runs.
  await atOnce(page, [["#step"]]);
  await atOnce(page, [["#play"]]);
  const now = await clock(page);
  await pass(page, 0.5);
  await expect(page.locator("#play")).toHaveText("Pause");
  // The button stops it, however much there is to be taken in before.
  await atOnce(page, [["R", "600"], ["#play"], ["R", "700"]]);
  await expect(page.locator("#play")).toHaveText("Run");
  await expect.poll(() => saved(page, "Save TOML")).toMatch(/^horizon = 25$[^]*^r = 700$/m);
  expect(await clock(page)).toBeGreaterThan(now);
});

test("a push within the limits is survived", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await until(page, 0.5);
  await setPush(page, 5);
  await page.getByRole("button", { name: "\u2192" }).click();
  await pass(page, 5.5);
  await expect(page.locator("#alert")).toBeHidden();
  const csv = table(await saved(page, "Save CSV"));
  expect(largest(csv["theta_dot_rad_s"])).toBeGreaterThan(0.5);
  expect(Math.abs(csv["theta_rad"]?.at(-1) ?? NaN)).toBeLessThan(0.02);
});

test("a push that is too large ends on the floor, with the reason", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await until(page, 0.5);
  await setPush(page, 20);
  await page.getByRole("button", { name: "\u2192" }).click();
  await expect(page.locator("#alert")).toContainText("the robot has fallen: theta", { timeout: 30_000 });
  await expect(page.locator("#alert")).toContainText("LPV MPC");
  // Soft bounds leave a plan as long as the robot stands; what was not enough is the torque.
  await expect(page.locator("#alert")).toContainText(/the torque had been at its bound for .* s/);
});

test("in an ideal world a controller without a plan gives up, and says which bound", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "tight-bounds");
  await page.locator("#play").click();
  await until(page, 0.2);
  await setPush(page, 40);
  await page.getByRole("button", { name: "\u2192" }).click();
  await expect(page.locator("#alert")).toContainText(/no plan at t = .* s: infeasible: .* bound of .* cannot be met/);
  await expect(page.locator("#status")).toContainText("on the floor");
  // Without a plan there is no cost: an empty cell. This file can be played, and the program's own.
  const csv = await saved(page, "Save CSV");
  expect(csv).not.toContain("NaN");
  const costs = table(csv)["cost"] ?? [];
  expect(costs.slice(0, -1).some(Number.isNaN)).toBe(true);
  await openFile(page, "fallen.csv", csv);
  await expect(page.locator("#title")).toHaveText("recorded: fallen.csv");
  await scenario(page, "tight-bounds");
  await openFile(page, "simulated.csv", simulated(await saved(page, "Save TOML"))("trajectory.csv"));
  await expect(page.locator("#title")).toHaveText("recorded: simulated.csv");
});

test("the target can be dragged on the floor", async ({ page }) => {
  await open(page);
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  const [x, y] = [box.x + box.width * 0.75, box.y + box.height * 0.75];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 40, y - 30, { steps: 4 });
  await page.mouse.up();
  await pass(page, 6);
  const target = Number(await page.getByLabel("Target X", { exact: true }).inputValue());
  expect(Math.abs(target)).toBeGreaterThan(0.1);
  const phi = table(await saved(page, "Save CSV"))["phi_rad"]?.at(-1) ?? NaN;
  expect(phi * 0.12).toBeCloseTo(target, 1);
});

test("the camera turns, and the robot stays; the plots show either plane; the set-up folds away", async ({ page }) => {
  const problems = await open(page);
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  // The floor's lines, beside words and robot.
  const clip = { x: box.x, y: box.y + box.height * 0.3, width: box.width * 0.25, height: box.height * 0.4 };
  let before = await page.screenshot({ clip });
  await expect.poll(async () => {
    const last = before;
    before = await page.screenshot({ clip });
    return before.equals(last);
  }, { intervals: [500] }).toBe(true);
  await page.getByText("Camera", { exact: true }).click();
  await page.mouse.move(box.x + box.width * 0.7, box.y + box.height * 0.7);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.4, box.y + box.height * 0.6, { steps: 4 });
  await page.mouse.up();
  await expect.poll(async () => (await page.screenshot({ clip })).equals(before)).toBe(false);
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0");
  await expect(page.locator("#clock")).toHaveText("0.00 s");

  await fill(page, "Target Y", "0.5");
  await until(page, 4);
  await pause(page);
  const phi = async () => parseFloat((await page.locator("#plots figcaption > span").first().textContent()) ?? "");
  expect(Math.abs(await phi())).toBeLessThan(0.01);
  await page.getByText("y plane", { exact: true }).click();
  await expect.poll(phi).toBeGreaterThan(0.4);

  await page.getByRole("button", { name: "Set-up" }).click();
  await expect(page.locator("#panel")).toBeHidden();
  await page.getByRole("button", { name: "Set-up" }).click();
  await expect(page.locator("#panel")).toBeVisible();
  expect(problems).toEqual([]);
});

test("a drawn path is followed", async ({ page }) => {
  await open(page);
  await page.getByText("Draw path").click();
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  await page.mouse.move(box.x + box.width * 0.25, box.y + box.height * 0.8);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.45, box.y + box.height * 0.85, { steps: 8 });
  await page.mouse.move(box.x + box.width * 0.7, box.y + box.height * 0.78, { steps: 8 });
  await page.mouse.up();
  await pass(page, 6);
  const toml = await saved(page, "Save TOML");
  expect(toml).toContain("[reference.planes.x.lines]");
  await expect(page.locator("#alert")).toBeHidden();
  const { phi_rad: phi = [], phi_ref_rad: reference = [] } = table(await saved(page, "Save CSV"));
  // It goes to the left and back to the right, and the robot goes along.
  expect(Math.max(...reference) - Math.min(...reference)).toBeGreaterThan(5);
  const errors = phi.map((value, i) => value - (reference[i] ?? NaN));
  expect(Math.sqrt(errors.reduce((sum, error) => sum + error ** 2, 0) / errors.length)).toBeLessThan(0.4);
  expect(largest(errors)).toBeLessThan(1.5);
});

test("active bounds are named, with the time at which they begin", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "tight-bounds");
  await page.locator("#step").click();
  await expect(page.locator("#status")).toContainText(/\d+ active bounds? \(.*(theta|torque|phi_dot|theta_dot) (lower|upper) \d\.\d\d s ahead/);
});

/** The x that solves four linear equations, each a row with its right side. */
function solved(rows: number[][]): number[] {
  for (let column = 0; column < 4; column++) {
    const rest = rows.slice(column).sort((a, b) => Math.abs(b[column] ?? 0) - Math.abs(a[column] ?? 0));
    rows.splice(column, rest.length, ...rest);
    const pivot = rows[column] ?? [];
    for (const row of rows) {
      if (row === pivot) continue;
      const factor = (row[column] ?? 0) / (pivot[column] ?? NaN);
      for (const [k, value] of pivot.entries()) row[k] = (row[k] ?? 0) - factor * value;
    }
  }
  return rows.map((row, i) => (row[4] ?? NaN) / (row[i] ?? NaN));
}

/** How far the torques are from clip(-K (x - x_ref)) with the K that fits those within the bounds
 *  best, N m. The plan of one sample is for its end, so x_ref is that of the next row. */
function distanceFromLaw(run: Table): number {
  const at = (column: string, i: number) => run[column]?.[i] ?? NaN;
  const samples = (run["t_s"] ?? []).slice(0, -1).map((_, i) => ({
    x: [at("phi_rad", i) - at("phi_ref_rad", i + 1), at("theta_rad", i), at("phi_dot_rad_s", i), at("theta_dot_rad_s", i)],
    u: at("torque_nm", i),
  }));
  const free = samples.filter(({ u }) => Math.abs(u) < 1.5 - 1e-9);
  const sum = (term: (sample: { x: number[]; u: number }) => number) => free.reduce((total, sample) => total + term(sample), 0);
  const gain = solved([0, 1, 2, 3].map((i) => [
    ...[0, 1, 2, 3].map((j) => sum(({ x }) => (x[i] ?? NaN) * (x[j] ?? NaN))), sum(({ x, u }) => (x[i] ?? NaN) * u),
  ]));
  const law = (x: number[]) => x.reduce((total, value, i) => total + value * (gain[i] ?? NaN), 0);
  return Math.max(...samples.map(({ x, u }) => Math.abs(Math.min(Math.max(law(x), -1.5), 1.5) - u)));
}

test("three robots run side by side", async ({ page }) => {
  const problems = await openFlat(page);
  await scenario(page, "two-setpoints");
  await page.locator(".panel").getByLabel("linear MPC").check();
  await page.locator(".panel").getByLabel("LQR").check();
  await page.locator("#play").click();
  await until(page, 1.5);
  await expect(page.locator("#status > div")).toHaveCount(3);
  await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
  const runs: Promise<[string, string]>[] = [];
  page.on("download", (download) => runs.push(download.path().then((path) => [download.suggestedFilename(), readFileSync(path, "utf8")])));
  await page.getByRole("button", { name: "Save CSV" }).click();
  await expect.poll(() => runs.length).toBe(3);
  const files = Object.fromEntries(await Promise.all(runs));
  // The first robot's run is that of the same scenario alone; the others are those of theirs.
  const toml = await saved(page, "Save TOML");
  expectSame(files["trajectory_lpv.csv"] ?? "", simulated(toml)("trajectory.csv"));
  const linear = simulated(toml.replace('model = "lpv"', 'model = "linear"'));
  expectSame(files["trajectory_linear.csv"] ?? "", linear("trajectory.csv"));
  const lqr = table(files["trajectory_lqr.csv"] ?? "");
  expect(distanceFromLaw(lqr)).toBeLessThan(1e-6);
  expect(distanceFromLaw(table(files["trajectory_linear.csv"] ?? ""))).toBeGreaterThan(1e-2);
  expect(problems).toEqual([]);
});
