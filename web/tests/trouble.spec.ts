// What goes wrong is said, and what was there stays.

import { expect, test } from "@playwright/test";
import { drop, fill, openFlat, saved, scenario, table, until } from "./page";
import { expectSameUntil } from "./program";

test("without the control loop's program the page says so", async ({ page }) => {
  await page.route("**/worker*.js", (route) => route.abort());
  await page.goto("./?flat");
  await expect(page.locator("#message")).toContainText("program cannot be loaded");
  await expect(page.locator("#play")).toBeDisabled();
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(error.message));
  await page.locator("#scene").click();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("r");
  await page.emulateMedia({ colorScheme: "dark" });
  await page.waitForTimeout(200);
  expect(problems).toEqual([]);
});

for (const name of ["tight-bounds", "lissajous"]) {
  test(`a run of ${name} that ended in a fall is saved and played back`, async ({ page }) => {
    await openFlat(page);
    await scenario(page, name);
    await page.locator("#play").click();
    await until(page, 0.2);
    await fill(page, "Push", "40");
    await page.getByRole("button", { name: "\u2192" }).click();
    await expect(page.locator("#alert")).toContainText("no plan at t = ");
    await expect(page.locator("#status")).toContainText("on the floor");
    const csv = await saved(page, "Save CSV");
    const times = table(csv)["t_s"] ?? [];
    for (const [k, time] of times.slice(0, -1).entries()) expect(time).toBeCloseTo(0.05 * k, 9);
    expect(csv).not.toContain("NaN");
    await drop(page, [["trajectory.csv", csv]]);
    await expect(page.locator("#title")).toHaveText("recorded: trajectory.csv");
    await expect(page.locator("#message")).toContainText("End of the recording", { timeout: 30_000 });
  });
}

test("a push by hand stands in the file at its time", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "drive");
  await page.locator("#play").click();
  await until(page, 0.5);
  await fill(page, "Push", "1");
  await page.getByRole("button", { name: "\u2192" }).click();
  await until(page, 1.5);
  await page.locator("#play").click();
  const csv = await saved(page, "Save CSV");
  const toml = await saved(page, "Save TOML");
  expect(toml).toContain("theta_dot_rad_s = -1");
  expectSameUntil(1.4, csv, toml, "trajectory_x.csv");
});

test("an emptied field that needs a number is refused, and shows what holds", async ({ page }) => {
  await openFlat(page);
  for (const [label, value] of [["Horizon N", "20"], ["Sampling t_s", "50"], ["Q phi", /\d/], ["R", /\d/]] as const) {
    await fill(page, label, "");
    await expect(page.locator("#message")).toContainText("controller.");
    await expect(page.locator("#message")).toContainText("NaN");
    await expect(page.locator(".panel").getByLabel(label, { exact: true })).toHaveValue(value);
  }
});

test("programs per sample go in and out of the set-up", async ({ page }) => {
  await openFlat(page);
  await fill(page, "QPs", "3");
  expect(await saved(page, "Save TOML")).toContain("most = 3");
  await fill(page, "QPs", "");
  expect(await saved(page, "Save TOML")).not.toContain("iterations");
  await fill(page, "QPs", "1000000");
  await expect(page.locator("#message")).toContainText("controller.iterations.descent.most = 1000000: at most 1000");
  await fill(page, "Sub-steps", "1000000000");
  await expect(page.locator("#message")).toContainText("substeps = 1000000000: at most 1000");
  await expect(page.locator("#message")).not.toBeHidden();
});
