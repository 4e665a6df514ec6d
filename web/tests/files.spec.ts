// Files and links: out and in again, and what happens with broken ones.

import { readFileSync } from "node:fs";
import { expect, test } from "@playwright/test";
import { drop, fill, openFlat, openFile, openSection, ready, saved, scenario, until } from "./page";

test("a link holds the whole set-up", async ({ page, context }) => {
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await openFlat(page);
  await scenario(page, "lissajous");
  await fill(page, "Horizon N", "33");
  await page.locator(".panel").getByLabel("LQR").check();
  const before = await saved(page, "Save TOML");
  await page.getByRole("button", { name: "Copy link" }).click();
  await expect(page.locator("#message")).toContainText("link");
  const address = page.url();
  expect(await page.evaluate(() => navigator.clipboard.readText())).toBe(address);
  const other = await context.newPage();
  await other.goto(address);
  await ready(other);
  expect(await saved(other, "Save TOML")).toBe(before);
  await expect(other.locator(".panel").getByLabel("LQR")).toBeChecked();
});

test("a TOML file goes out and in", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "single-setpoint");
  await fill(page, "R", "321");
  const toml = await saved(page, "Save TOML");
  await scenario(page, "drive");
  await openFile(page, "mine.toml", toml);
  await expect(page.getByLabel("R", { exact: true })).toHaveValue("321");
  expect(await saved(page, "Save TOML")).toBe(toml);
});

test("every built-in file goes in as it stands", async ({ page }) => {
  await openFlat(page);
  for (const name of ["two-setpoints", "lissajous", "tight-bounds", "single-setpoint-terminal", "two-setpoints-linear", "far-setpoints"]) {
    const text = readFileSync(`../crates/ballbot-scenario/src/builtin/${name}.toml`, "utf8");
    await openFile(page, `${name}.toml`, text);
    await expect(page.locator("#title")).toHaveText(/^title\s*=\s*"(.*)"/m.exec(text)?.[1] ?? "");
  }
});

test("a recorded run is played back", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  await page.locator("#play").click();
  await until(page, 2);
  await page.locator("#play").click();
  const csv = await saved(page, "Save CSV");
  await openFile(page, "trajectory.csv", csv);
  await expect(page.locator("#title")).toHaveText("recorded: trajectory.csv");
  await expect(page.locator("#message")).toContainText("End of the recording", { timeout: 30_000 });
  expect(await saved(page, "Save CSV")).toBe(csv);
  await page.locator("#reset").click();
  await expect(page.locator("#clock")).toHaveText("0.00 s");
});

test("a recorded run of two planes is dropped on the page and played back", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "lissajous");
  await page.locator("#play").click();
  await until(page, 2);
  await page.locator("#play").click();
  const downloads: Promise<string>[] = [];
  page.on("download", (download) => downloads.push(download.path().then((path) => readFileSync(path, "utf8"))));
  await page.getByRole("button", { name: "Save CSV" }).click();
  await expect.poll(() => downloads.length).toBe(2);
  const [x = "", y = ""] = await Promise.all(downloads);
  await scenario(page, "two-setpoints");
  // In the wrong order: their names say which is which.
  await drop(page, [["trajectory_y.csv", y], ["trajectory_x.csv", x]]);
  await expect(page.locator("#title")).toHaveText("recorded: trajectory_x.csv, trajectory_y.csv");
  await expect(page.locator("#message")).toContainText("End of the recording", { timeout: 30_000 });
  await page.getByRole("button", { name: "Save CSV" }).click();
  await expect.poll(() => downloads.length).toBe(4);
  expect(await Promise.all(downloads.slice(2))).toEqual([x, y]);
  await drop(page, [["notes.txt", "x"]]);
  await expect(page.locator("#message")).toContainText("neither a set-up");
});

const BROKEN: [name: string, text: string, message: string][] = [
  ["broken.toml", "title = ", "Invalid TOML"],
  ["unknown.toml", "titel = 'x'", "unknown field"],
  ["broken.csv", "t_s,phi_rad\n0,1\n", "theta_rad"],
  ["letters.csv", "t_s,phi_rad,theta_rad,phi_dot_rad_s,theta_dot_rad_s,torque_nm,phi_ref_rad\n0,0,0,0,0,0,0\n1,x,0,0,0,0,0\n2,0,0,0,0,,0\n", "line 3"],
  ["order.csv", "t_s,phi_rad,theta_rad,phi_dot_rad_s,theta_dot_rad_s,torque_nm,phi_ref_rad\n1,0,0,0,0,0,0\n0,0,0,0,0,0,0\n2,0,0,0,0,,0\n", "line 3"],
  ["picture.png", "x", "neither a set-up"],
];

test("broken files get a message and change nothing", async ({ page }) => {
  await openFlat(page);
  await fill(page, "R", "777");
  const before = await saved(page, "Save TOML");
  for (const [name, text, message] of BROKEN) {
    await openFile(page, name, text);
    await expect(page.locator("#message")).toContainText(message);
    expect(await saved(page, "Save TOML")).toBe(before);
  }
});

test("a broken link gets a message and the page starts all the same", async ({ page }) => {
  for (const fragment of ["1.AAAA", "nonsense", "2.abc", "1.%%%"]) {
    await page.goto("about:blank");
    await page.goto(`./#${fragment}`);
    await ready(page);
    await expect(page.locator("#message")).toContainText("does not hold a set-up");
    await expect(page.locator("#title")).toContainText("Drive");
  }
});

test("a set-up from a bad value in a link changes nothing", async ({ page }) => {
  await openFlat(page);
  await openSection(page, "Controller");
  const before = await saved(page, "Save TOML");
  await openFile(page, "bad.toml", before.replace("horizon = 20", "horizon = 0"));
  await expect(page.locator("#message")).toContainText("controller.horizon");
  expect(await saved(page, "Save TOML")).toBe(before);
});
