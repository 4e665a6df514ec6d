// Files and links: out and in again, and what happens with broken ones.

import { readFileSync } from "node:fs";
import { expect, type Page } from "@playwright/test";
import { parse } from "smol-toml";
import { readTrajectory } from "../src/files";
import { NOW, NOW_WIDTH, ROW } from "../src/layout";
import { Playback } from "../src/playback";
import type { Batch } from "../src/protocol";
import { toToml } from "../src/scenario";
import { clearMessage, drop, fill, fragment, openFile, openFlat, pass, pause, ready, saved, scenario, test, until } from "./page";

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
  await expect(page.locator("#message")).toContainText("End of the scenario", { timeout: 60_000 });
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
  await pause(page);
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

/** A recording of one plane: a sample every 0.05 s, at rest. */
function recording(start: number, samples: number): string {
  const header = "t_s,phi_rad,theta_rad,phi_dot_rad_s,theta_dot_rad_s,torque_nm,phi_ref_rad,cost,status,step_us";
  const times = Array.from({ length: samples + 1 }, (_, i) => (start + 0.05 * i).toFixed(2));
  return [header, ...times.map((time, i) => `${time},0,0,0,0,${i < samples ? 0 : ""},0,,,`)].join("\n");
}

test("a recording begins at its first row, goes on row by row and plays again from its end", async ({ page }) => {
  await openFlat(page);
  await page.locator("#speed").selectOption("0.02");
  await openFile(page, "late.csv", recording(60, 8));
  await expect(page.locator("#clock")).toHaveText(/^60\.0/);
  await pause(page);
  await page.locator("#reset").click();
  await expect(page.locator("#clock")).toHaveText("60.00 s");
  for (const time of ["60.05 s", "60.10 s", "60.15 s"]) {
    await page.locator("#step").click();
    await expect(page.locator("#clock")).toHaveText(time);
  }
  for (let i = 0; i < 5; i++) await page.locator("#step").click();
  await expect(page.locator("#clock")).toHaveText("60.40 s");
  await expect(page.locator("#message")).toContainText("End of the recording");
  await page.locator("#play").click();
  await expect(page.locator("#play")).toHaveText("Pause");
  await expect(page.locator("#clock")).toHaveText(/^60\.[01]/);
});

test("what a recording does not tell is a dash", async ({ page }) => {
  await openFlat(page);
  await openFile(page, "trajectory.csv", recording(0, 3));
  await expect(page.locator("#message")).toContainText("End of the recording");
  const values = page.locator("#plots figcaption > span");
  await expect(values.first()).toHaveText("0.000");
  for (const i of [5, 6, 7, 8]) await expect(values.nth(i)).toHaveText("\u2013");
});

test("a recorded cost that is not finite is unknown, as the page writes it", () => {
  const [header, first, second, last] = recording(0, 2).split("\n");
  const withCost = (cost: string) => [header, first?.replace(/,0,,,$/, `,0,${cost},,`), second, last].join("\n");
  for (const cost of ["inf", "-inf", "NaN", ""]) {
    expect(readTrajectory(withCost(cost), "program.csv").rows.map((row) => row[ROW.cost])).toEqual([NaN, NaN]);
  }
  expect(() => readTrajectory(withCost("much"), "program.csv")).toThrow('line 2: "much" in the column cost');
  expect(() => readTrajectory(withCost("").replace("0.00,0,", "0.00,NaN,"), "program.csv")).toThrow("phi_rad");
});

test("a large whole number in a file can be read again", () => {
  const parsed = (value: number) => parse(toToml({ value } as never))["value"];
  for (const value of [1e20, -1e20, 2 ** 53, 2 ** 60, 1e300, Number.MAX_SAFE_INTEGER, 5, 0.1]) expect(parsed(value)).toBe(value);
});

test("the reference of a long recording reaches its end on the floor", () => {
  const planes = [readTrajectory(recording(0, 10_000), "long.csv")];
  for (const [i, row] of planes[0]?.rows.entries() ?? []) row[6] = i;
  const [reference] = new Playback(planes).references();
  expect(reference?.length).toBe(2048);
  expect([reference?.[0], reference?.at(-1)]).toEqual([0, 9999]);
  const gaps = [...(reference ?? [])].slice(1).map((value, i) => value - (reference?.[i] ?? NaN));
  expect([Math.min(...gaps), Math.max(...gaps)]).toEqual([4, 5]);
});

test("of two recorded planes of different length the longer one stays where it was when the other ended", () => {
  const short = readTrajectory(recording(0, 2).replace(/,0,,,$/m, ",0,,solved,").replace(/,,,$/, ",,no plan,"), "x.csv");
  const long = readTrajectory(recording(0, 5).replace("0.05,0,0,0,0,0,0,,,", "0.05,0,0,0,0,0,0,,infeasible,").replace("0.10,0,", "0.10,1,").replace("0.25,0,", "0.25,9,"), "y.csv");
  const playback = new Playback([short, long]);
  let last: Batch | undefined;
  const statuses: string[] = [];
  playback.onBatch = (batch) => {
    last = batch;
    for (const { text } of batch.robots[0]?.statuses ?? []) statuses.push(text);
  };
  for (let i = 0; i < 3; i++) playback.step();
  const now = last?.robots[0]?.now;
  expect([now?.[NOW.time], now?.[NOW_WIDTH + NOW.time], now?.[NOW_WIDTH + NOW.phi]]).toEqual([0.1, 0.1, 1]);
  // Of each sample what needs attention in either plane.
  expect(statuses).toEqual(["solved", "infeasible"]);
});

test("a recording that is looked back at begins anew at its beginning", async ({ page }) => {
  await openFlat(page);
  await openFile(page, "trajectory.csv", recording(0, 20));
  await expect(page.locator("#message")).toContainText("End of the recording");
  await page.getByRole("slider", { name: "Look back" }).fill("0.5");
  await expect(page.locator("#clock")).toHaveText("0.50 s");
  await page.locator("#reset").click();
  await expect(page.locator("#clock")).toHaveText("0.00 s");
});

/** Animation frames that are asked for between two frames of the screen. */
function framesAskedFor(page: Page): Promise<number> {
  return page.evaluate(async () => {
    const ask = window.requestAnimationFrame;
    const next = () => new Promise((resolve) => ask.call(window, resolve));
    let asked = 0;
    window.requestAnimationFrame = (callback) => {
      asked++;
      return ask.call(window, callback);
    };
    await next();
    asked = 0;
    for (let i = 0; i < 20; i++) await next();
    window.requestAnimationFrame = ask;
    return Math.round(asked / 20);
  });
}

test("another speed does not make a recording's work more", async ({ page }) => {
  await openFlat(page);
  await openFile(page, "trajectory.csv", recording(0, 2000));
  await until(page, 0.2);
  const before = await framesAskedFor(page);
  for (const speed of ["0.5", "0.25", "0.1", "0.5", "1"]) await page.locator("#speed").selectOption(speed);
  expect(await framesAskedFor(page)).toBe(before);
  await pass(page, 0.5);
});

const NOT_ONE_RUN: [files: [name: string, text: string][], message: string][] = [
  [[["trajectory_lpv.csv", recording(0, 3)], ["trajectory_linear.csv", recording(0, 3)]], "these are not one run"],
  [[["lpv_x.csv", recording(0, 3)], ["linear_y.csv", recording(0, 3)]], "these are not one run"],
  [[["a_x.csv", recording(0, 3)], ["a_y.csv", recording(0, 3)], ["b.csv", recording(0, 3)]], "these are not one run"],
  [[["a_x.csv", recording(0, 3)], ["a_y.csv", recording(0, 4)]], "3 samples and 4 samples"],
  [[["a_x.csv", recording(0, 3)], ["a_y.csv", recording(1, 3)]], "row 1: t_s = 0 and t_s = 1"],
];

test("recordings that are not one run get a message and change nothing", async ({ page }) => {
  await openFlat(page);
  const title = (await page.locator("#title").textContent()) ?? "";
  for (const [files, message] of NOT_ONE_RUN) {
    await clearMessage(page);
    await drop(page, files);
    await expect(page.locator("#message")).toContainText(message);
    await expect(page.locator("#title")).toHaveText(title);
  }
  await drop(page, [["A_X.CSV", recording(0, 3)], ["a_y.csv", recording(0, 3)]]);
  await expect(page.locator("#title")).toHaveText("recorded: A_X.CSV, a_y.csv");
  // A plane that ended before the other says why in its last row.
  const short = recording(0, 3).replace(/,,,$/, ",,no plan,");
  await drop(page, [["b_x.csv", short], ["b_y.csv", recording(0, 5)]]);
  await expect(page.locator("#title")).toHaveText("recorded: b_x.csv, b_y.csv");
});

test("what cannot be read gets a message, and what is no set-up or run is not read", async ({ page }) => {
  const problems = await openFlat(page);
  // As browsers do with a dropped folder.
  await page.evaluate(() => {
    Blob.prototype.text = function (this: Blob) {
      document.body.dataset["read"] = `${document.body.dataset["read"] ?? ""}${(this as File).name};`;
      return Promise.reject(new DOMException("not found", "NotFoundError"));
    };
  });
  await drop(page, [["out", ""]]);
  await expect(page.locator("#message")).toContainText("out: this is neither a set-up (.toml) nor a recorded run (.csv)");
  await drop(page, [["film.mp4", ""], ["out.csv", ""]]);
  await expect(page.locator("#message")).toContainText("out.csv: this cannot be read");
  await drop(page, [["out.toml", ""], ["other.csv", ""]]);
  await expect(page.locator("#message")).toContainText("out.toml: this cannot be read");
  await expect(page.locator("body")).toHaveAttribute("data-read", "out.csv;out.toml;");
  expect(problems).toEqual([]);
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
    await clearMessage(page);
    await openFile(page, name, text);
    await expect(page.locator("#message")).toContainText(message);
    expect(await saved(page, "Save TOML")).toBe(before);
  }
});

test("a broken link gets a message and the page starts all the same", async ({ page }) => {
  for (const fragment of ["1.AAAA", "nonsense", "2.abc", "1.%%%"]) {
    await page.goto("about:blank");
    await page.goto(`./?flat#${fragment}`);
    await ready(page);
    await expect(page.locator("#message")).toContainText("does not hold a set-up");
    await expect(page.locator("#title")).toContainText("Drive");
  }
});

test("a link with a bad value gets a message and changes nothing", async ({ page }) => {
  await openFlat(page);
  const before = await saved(page, "Save TOML");
  const go = (toml: string) => page.evaluate((hash) => (location.hash = hash), fragment(toml));
  await go(before.replace("horizon = 20", "horizon = 0"));
  await expect(page.locator("#message")).toContainText("controller.horizon");
  expect(await saved(page, "Save TOML")).toBe(before);
  await go(before.replace("horizon = 20", "horizon = 21"));
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("21");
});

test("a small link does not unpack to a large set-up", async ({ page }) => {
  await openFlat(page);
  const before = await saved(page, "Save TOML");
  const large = fragment(`${before.replace("horizon = 20", "horizon = 21")}#${" ".repeat(20_000_000)}`);
  expect(large.length).toBeLessThan(50_000);
  await page.evaluate((hash) => (location.hash = hash), large);
  await expect(page.locator("#message")).toContainText("does not hold a set-up");
  expect(await saved(page, "Save TOML")).toBe(before);
});

test("a set-up that is too large for a link gets a message", async ({ page }) => {
  await openFlat(page);
  const toml = await saved(page, "Save TOML");
  const address = page.url();
  // Random digits do not become shorter.
  const title = Array.from({ length: 100_000 }, () => Math.random().toString(36).slice(2, 6)).join("");
  await openFile(page, "large.toml", toml.replace(/^title = .*$/m, `title = "${title}"`));
  await expect(page.locator("#title")).toHaveText(title);
  await page.getByRole("button", { name: "Copy link" }).click();
  await expect(page.locator("#message")).toContainText(/too large for a link: \d+ characters, at most 200000/);
  expect(page.url()).toBe(address);
});
