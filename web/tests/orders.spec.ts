// What a person orders: targets, paths and pushes arrive as they were meant, and stand in the file.

import { readFileSync } from "node:fs";
import { expect, type Download, type Page } from "@playwright/test";
import { atOnce, clearMessage, clock, fill, largest, open, openFile, openFlat, pass, pause, ready, saved, scenario, setPush, settled, table, test, until, type Table } from "./page";
import { beforeEnd, expectSameUntil } from "./program";

/** Presses at a place of the scene (parts of its size), moves by pixels, lets go. */
async function drag(page: Page, [left, top]: [number, number], [right, down]: [number, number]): Promise<void> {
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  const [x, y] = [box.x + box.width * left, box.y + box.height * top];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + right / 2, y + down / 2);
  await page.mouse.move(x + right, y + down);
  await page.mouse.up();
}

/** The run so far in both planes. */
async function planes(page: Page): Promise<[Table, Table]> {
  const files = new Map<string, Promise<string>>();
  const keep = (download: Download) => void files.set(download.suggestedFilename(), download.path().then((path) => readFileSync(path, "utf8")));
  page.on("download", keep);
  await page.getByRole("button", { name: "Save CSV" }).click();
  await expect.poll(() => files.size).toBe(2);
  page.off("download", keep);
  const run = async (name: string) => table((await files.get(name)) ?? "");
  return [await run("trajectory_x.csv"), await run("trajectory_y.csv")];
}

/** The first tilt rates of the run that are not zero, in both planes. */
async function tiltRates(page: Page): Promise<[number, number]> {
  const first = ({ theta_dot_rad_s: rates = [] }: Table) => rates.find((rate) => Math.abs(rate) > 1e-6) ?? 0;
  const [x, y] = await planes(page);
  return [first(x), first(y)];
}

/** Where the robot is to go at the end of the run, m. */
async function lastTarget(page: Page): Promise<number[]> {
  return (await planes(page)).map(({ phi_ref_rad: targets = [] }) => 0.12 * (targets.at(-1) ?? NaN));
}

test("a body that is hardly dragged is hardly pushed", async ({ page }) => {
  await open(page);
  await drag(page, [0.5, 0.5], [3, 0]);
  await until(page, 1);
  await expect(page.locator("#alert")).toBeHidden();
  const [x, y] = await tiltRates(page);
  // It was pushed, not sent: the target is where it was.
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0");
  expect(Math.hypot(x, y)).toBeGreaterThan(0.01);
  expect(Math.hypot(x, y)).toBeLessThan(1);
});

test("a body is pushed the way it is dragged", async ({ page }) => {
  await openFlat(page);
  await drag(page, [0.5, 0.5], [20, 0]);
  await until(page, 1);
  const [x, y] = await tiltRates(page);
  // Towards +x it leans with a negative theta.
  expect(x).toBeLessThan(-0.1);
  expect(Math.abs(y)).toBeLessThan(0.05 * Math.abs(x));
});

test("a second finger turns the camera, and sends the robot nowhere", async ({ browser }) => {
  const context = await browser.newContext({ viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true });
  const page = await context.newPage();
  await open(page);
  await page.locator("#scene").evaluate((scene) => {
    const element = scene.querySelector("canvas") ?? scene;
    const box = element.getBoundingClientRect();
    const send = (kind: string, pointerId: number, x: number) =>
      element.dispatchEvent(new PointerEvent(kind, {
        pointerId, pointerType: "touch", isPrimary: pointerId === 11, button: 0, bubbles: true,
        clientX: box.left + box.width * x, clientY: box.top + box.height * 0.85,
      }));
    // A synthetic pointer cannot be captured.
    element.setPointerCapture = () => {};
    element.releasePointerCapture = () => {};
    send("pointerdown", 11, 0.7);
    send("pointermove", 11, 0.705);
    send("pointerdown", 12, 0.3);
    send("pointermove", 12, 0.1);
    send("pointerup", 12, 0.1);
    send("pointerup", 11, 0.705);
  });
  await settled(page);
  expect(await page.getByLabel("Target X", { exact: true }).inputValue()).toBe("0");
  expect(await page.locator("#play").textContent()).toBe("Run");
  await context.close();
});

test("one target follows another at once", async ({ page }) => {
  await openFlat(page);
  await atOnce(page, [["Target X", "0.5"], ["Target Y", "-0.25"]]);
  await until(page, 0.5);
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0.5");
  await expect(page.getByLabel("Target Y", { exact: true })).toHaveValue("-0.25");
});

test("targets that wait for a change are those that were meant", async ({ page }) => {
  await openFlat(page);
  await fill(page, "Target X", "1");
  await until(page, 0.5);
  await atOnce(page, [["#reset"], ["Target X", "0.5"], ["Target Y", "-0.25"]]);
  await settled(page);
  await until(page, 0.2);
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0.5");
  await expect(page.getByLabel("Target Y", { exact: true })).toHaveValue("-0.25");
  expect(await lastTarget(page)).toEqual([0.5, -0.25]);
  // Arrows count from where it is to go, and that is the origin after a reset.
  await page.evaluate(() => {
    document.getElementById("reset")?.click();
    const arrow = () => document.getElementById("scene")?.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    arrow();
    arrow();
  });
  await settled(page);
  await until(page, 0.2);
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0.5");
  await expect(page.getByLabel("Target Y", { exact: true })).toHaveValue("0");
  // One plane has no y.
  await atOnce(page, [["Scenario", "two-setpoints"], ["Target Y", "0.5"]]);
  await settled(page);
  await expect(page.locator("#title")).toContainText("Two set points");
  await until(page, 0.2);
  await expect(page.getByLabel("Target Y", { exact: true })).toHaveValue("0");
});

test("a target that is no place is refused", async ({ page }) => {
  await openFlat(page);
  await fill(page, "Target X", "1e300");
  await expect(page.locator("#message")).toContainText("at most 54 m");
  await clearMessage(page);
  await fill(page, "Target X", "");
  await expect(page.locator("#message")).toContainText("at most 54 m");
  await expect(page.locator("#play")).toHaveText("Run");
});

test("an order that no file may hold is refused when it is given, unless the set-up means it", async ({ page }) => {
  await openFlat(page);
  const toml = await saved(page, "Save TOML");
  const far = async () => {
    await clearMessage(page);
    await fill(page, "Target X", "55");
  };
  const hard = async () => {
    await clearMessage(page);
    await setPush(page, 101);
    await page.getByRole("button", { name: "\u2192" }).click();
    await settled(page);
  };
  await far();
  await expect(page.locator("#message")).toContainText("at most 54 m");
  await hard();
  await expect(page.locator("#message")).toContainText("at most 100 rad/s");
  await expect(page.locator("#play")).toHaveText("Run");
  expect(await saved(page, "Save TOML")).toBe(toml);
  await openFile(page, "unusual.toml", `accept_unusual_values = true\n${toml}`);
  await settled(page);
  await far();
  await hard();
  const unusual = await saved(page, "Save TOML");
  expect(unusual).toContain("theta_dot_rad_s = -101");
  await openFile(page, "again.toml", unusual.replace(/^title = .*$/m, 'title = "again"'));
  await expect(page.locator("#title")).toHaveText("again");
});

/** The page's robot and the program's see an order when it comes, not before. The run does not end before
 *  all is done, however busy the machine. */
async function blind(page: Page, name: string): Promise<void> {
  await scenario(page, name);
  const toml = await saved(page, "Save TOML");
  await openFile(page, "endless.toml", toml.replace(/^duration_s = .*$/m, "duration_s = 3600").replace(/^title = .*$/m, 'title = "endless"'));
  await expect(page.locator("#title")).toHaveText("endless");
  await page.locator(".panel").getByLabel("Sees the reference ahead").uncheck();
  await settled(page);
}

test("targets stand in the file as they were given", async ({ page }) => {
  await openFlat(page);
  await blind(page, "two-setpoints");
  await page.locator("#play").click();
  await until(page, 0.4);
  await fill(page, "Target X", "0.3");
  await pass(page, 0.6);
  await fill(page, "Target X", "-0.1");
  await pass(page, 0.4);
  // The horizon of the file is the last one: until then the run is that of the first one.
  const changed = await clock(page);
  await fill(page, "Horizon N", "30");
  await pass(page, 0.4);
  const csv = await saved(page, "Save CSV");
  const toml = await saved(page, "Save TOML");
  expect([...toml.matchAll(/time_s = /g)].length).toBeGreaterThanOrEqual(3);
  expectSameUntil(changed, csv, toml.replace("horizon = 30", "horizon = 20"));
});

async function moveSmoothly(page: Page): Promise<void> {
  await page.locator(".panel").getByLabel("Terminal", { exact: true }).selectOption("discrete_riccati");
  await page.evaluate(() => document.querySelectorAll("details").forEach((section) => (section.open = true)));
  await page.locator(".panel").getByLabel("Set points as smooth moves", { exact: true }).check();
}

test("smooth moves are those of the file", async ({ page }) => {
  await openFlat(page);
  await blind(page, "single-setpoint");
  await moveSmoothly(page);
  await page.locator("#play").click();
  await until(page, 0.4);
  await fill(page, "Target X", "0.4");
  await pass(page, 0.6);
  await fill(page, "Target X", "0.2");
  await fill(page, "Target X", "-0.2");
  await pass(page, 1.2);
  await pause(page);
  const csv = await saved(page, "Save CSV");
  const reference = table(csv)["phi_ref_rad"] ?? [];
  const steepest = Math.max(...reference.slice(1).map((value, i) => Math.abs(value - (reference[i] ?? value))));
  expect(steepest).toBeGreaterThan(0.05);
  expect(steepest).toBeLessThan(0.45);
  expectSameUntil(beforeEnd(csv), csv, await saved(page, "Save TOML"));
});

test("set points whose smooth moves waited at the first target are not in the file", async ({ page }) => {
  await openFlat(page);
  await blind(page, "single-setpoint");
  const points = "points = [{ time_s = 0.0, phi_rad = 0.0 }, { time_s = 0.1, phi_rad = 3.0 }, { time_s = 0.2, phi_rad = -2.0 }]";
  const toml = (await saved(page, "Save TOML")).replace(/points = \[[^]*?\]$/m, points).replace('"endless"', '"three points"');
  await openFile(page, "points.toml", toml);
  await expect(page.locator("#title")).toHaveText("three points");
  await moveSmoothly(page);
  await page.locator("#play").click();
  await until(page, 0.4);
  await fill(page, "Target X", "0.2");
  await pass(page, 2);
  await pause(page);
  const csv = await saved(page, "Save CSV");
  expectSameUntil(beforeEnd(csv), csv, await saved(page, "Save TOML"));
});

test("a smooth move that is ordered before the run begins where the set-up does, in the file, too", async ({ page }) => {
  await openFlat(page);
  await blind(page, "single-setpoint");
  await moveSmoothly(page);
  await fill(page, "Target X", "0.4");
  await pass(page, 1);
  await pause(page);
  const csv = await saved(page, "Save CSV");
  expectSameUntil(beforeEnd(csv), csv, await saved(page, "Save TOML"));
});

test("a path and a target after it stand in the file", async ({ page }) => {
  await openFlat(page);
  await blind(page, "drive");
  await page.getByText("Draw path").click();
  await drag(page, [0.3, 0.7], [120, 30]);
  await pass(page, 1);
  await fill(page, "Target X", "0.2");
  await pass(page, 1.2);
  await pause(page);
  const toml = await saved(page, "Save TOML");
  expect(toml).toContain("[reference.planes.x.lines]");
  const csv = await saved(page, "Save CSV");
  expect(largest(table(csv)["phi_rad"])).toBeGreaterThan(0.1);
  expectSameUntil(beforeEnd(csv), csv, toml, "trajectory_x.csv");
});

test("a set-up's own lines are followed in the file up to the first order", async ({ page }) => {
  await openFlat(page);
  await blind(page, "single-setpoint");
  const lines = "[reference.lines]\npoints = [{ time_s = 0.1, phi_rad = 0.5 }, { time_s = 0.4, phi_rad = 2.0 }, { time_s = 9.0, phi_rad = 4.0 }]";
  const toml = (await saved(page, "Save TOML")).replace(/\[reference\.set_points\]\npoints = \[[^]*?\]$/m, lines).replace('"endless"', '"three lines"');
  await openFile(page, "lines.toml", toml);
  await expect(page.locator("#title")).toHaveText("three lines");
  await page.locator("#play").click();
  await until(page, 0.8);
  await fill(page, "Target X", "0.2");
  await pass(page, 0.8);
  await pause(page);
  const csv = await saved(page, "Save CSV");
  expectSameUntil(beforeEnd(csv), csv, await saved(page, "Save TOML"));
});

test("the skip link goes to the set-up and says nothing", async ({ page }) => {
  await openFlat(page);
  await page.locator(".skip").focus();
  await page.keyboard.press("Enter");
  await expect(page.locator("#panel")).toBeFocused();
  await expect(page.locator("#message")).toBeHidden();
  await page.reload();
  await ready(page);
  await expect(page.locator("#message")).not.toContainText("link");
});
