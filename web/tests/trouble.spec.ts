// What goes wrong is said, and what was there stays.

import { expect } from "@playwright/test";
import { History } from "../src/history";
import { ROW, ROW_WIDTH } from "../src/layout";
import { followed } from "../src/pictures";
import { endingsInWords, stateOf } from "../src/status";
import { clock, drop, fill, fragment, open, openFile, openFlat, openSection, pass, pause, saved, scenario, setPush, table, test, until } from "./page";
import { beforeEnd, expectSameUntil, simulated } from "./program";

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
    await setPush(page, 40);
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

test("without a plan after a push, the file of an ideal world ends as the run did", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "tight-bounds");
  await page.locator("#play").click();
  await until(page, 0.4);
  await setPush(page, 8);
  await page.getByRole("button", { name: "\u2192" }).click();
  const ended = /no plan at t = ([\d.]+) s/;
  await expect(page.locator("#alert")).toContainText(ended);
  const [words = "", time] = ended.exec((await page.locator("#alert").textContent()) ?? "") ?? [];
  const [csv, toml] = [await saved(page, "Save CSV"), await saved(page, "Save TOML")];
  expectSameUntil(Number(time) - 1e-6, csv, toml);
  expect(simulated(toml)("trajectory.csv")).toContain(words);
});

test("a push by hand stands in the file at its time", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "drive");
  await page.locator("#play").click();
  await until(page, 0.5);
  await setPush(page, 1);
  await page.getByRole("button", { name: "\u2192" }).click();
  await pass(page, 1);
  await pause(page);
  const csv = await saved(page, "Save CSV");
  const toml = await saved(page, "Save TOML");
  expect(toml).toContain("theta_dot_rad_s = -1");
  expectSameUntil(beforeEnd(csv), csv, toml, "trajectory_x.csv");
});

test("an emptied field that needs a number is refused, and shows what holds", async ({ page }) => {
  await openFlat(page);
  for (const [label, key, value] of [["Horizon N", "horizon", "20"], ["Sampling t_s", "t_s", "50"], ["Q phi", "q", /\d/], ["R", "r", /\d/]] as const) {
    await fill(page, label, "");
    await expect(page.locator("#message")).toContainText(`controller.${key}`);
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
  await expect(page.locator("#message")).toContainText("substeps = 1e9: at most 1000");
  await expect(page.locator("#message")).not.toBeHidden();
});

test("times that no ballbot has are refused, in a field as in a link", async ({ page }) => {
  await openFlat(page);
  await openSection(page, "World");
  await openSection(page, "On a real robot");
  for (const [label, key] of [["Sampling t_s", "controller.t_s"], ["Known delay", "controller.delay_s"], ["Delay", "world.delay.transport_s"]] as const) {
    await fill(page, label, "1e9");
    await expect(page.locator("#message")).toContainText(`${key} = 1000000: more than 1 s`);
  }
  const toml = (await saved(page, "Save TOML")).replace("t_s = 0.05", "t_s = 1e6");
  await page.evaluate((hash) => (location.hash = hash), fragment(toml));
  await expect(page.locator("#message")).toContainText("controller.t_s = 1000000: more than 1 s");
  // Whoever means it is told what no controller can do.
  await page.evaluate((hash) => (location.hash = hash), fragment(`accept_unusual_values = true\n${toml}`));
  await expect(page.locator("#message")).toContainText("too long for the unstable pole");
  await page.locator("#play").click();
  await until(page, 0.3);
});

/** A set-up that passes every check, and whose samples take minutes. */
function endless(toml: string): string {
  return toml.replace("horizon = 20", "horizon = 200\niterations = { fixed = 1000 }\npredictor = { stage_consistent = { substeps = 1000 } }");
}

test("a controller that does not answer is ended, and the last settings that worked are offered", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await until(page, 0.5);
  const worked = await saved(page, "Save TOML");
  await openFile(page, "endless.toml", endless(worked));
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("200");
  await fill(page, "Target Y", "0.5");
  await expect(page.locator("#message")).toContainText("did not answer for 2 s and was ended");
  await expect(page.locator("#play")).toHaveText("Run");
  // What was done in both planes is still there.
  expect(await saved(page, "Save TOML")).toContain("[reference.planes.y");
  await page.getByRole("button", { name: "Go on with the last settings that worked" }).click();
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("20");
  expect(await saved(page, "Save TOML")).toBe(worked);
  await page.locator("#play").click();
  await until(page, 0.5);
  await expect(page.locator("#message")).toBeHidden();
});

test("a speed that is chosen while there is no controller is that of the next run", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await until(page, 0.2);
  await pause(page);
  await openFile(page, "endless.toml", endless(await saved(page, "Save TOML")));
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("200");
  await page.locator("#play").click();
  await expect(page.locator("#message")).toContainText("was ended");
  await page.locator("#speed").selectOption("0.02");
  await scenario(page, "two-setpoints");
  await page.locator("#play").click();
  await page.waitForTimeout(2000);
  expect(await clock(page)).toBeLessThan(0.5);
});

/** In front of the worker's program: every set-up takes four seconds to be prepared. */
const SLOW_MACHINE = `const make = WebAssembly.instantiateStreaming;
WebAssembly.instantiateStreaming = async (...source) => {
  const { module, instance } = await make(...source);
  const exports = { ...instance.exports };
  for (const name of ["simulation_new", "simulation_reconfigured"]) {
    exports[name] = (...given) => {
      for (const end = performance.now() + 4000; performance.now() < end;);
      return instance.exports[name](...given);
    };
  }
  return { module, instance: { exports } };
};`;

test("a set-up that a slow machine takes long to take in is waited for", async ({ page }) => {
  await page.route("**/worker*.js", async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, body: `${SLOW_MACHINE}\n${await response.text()}` });
  });
  await openFlat(page);
  // What it does unseen before the first run takes no longer.
  await page.waitForTimeout(3000);
  expect(await page.locator("#message").isVisible()).toBe(false);
  await page.locator("#play").click();
  await until(page, 0.5);
  await fill(page, "Horizon N", "25");
  await pass(page, 0.5);
  await expect(page.locator("#message")).toBeHidden();
});

test("a link whose controller does not answer leaves the page at work", async ({ page }) => {
  await openFlat(page);
  const toml = await saved(page, "Save TOML");
  await page.goto("about:blank");
  await page.goto(`./?flat#${fragment(endless(toml))}`);
  await expect(page.locator("#message")).toContainText("did not answer for 2 s and was ended");
  await scenario(page, "two-setpoints");
  await page.locator("#play").click();
  await until(page, 0.5);
});

test("a fallen robot is said to lie on the floor, and no word covers another", async ({ page }) => {
  await open(page);
  for (const label of ["linear MPC", "LQR"]) await page.locator(".panel").getByLabel(label, { exact: true }).check();
  await fill(page, "Target X", "2.5");
  await until(page, 4);
  await pause(page);
  // The LQR knows no bound of the tilt.
  const badges = page.locator("#status > div");
  await expect(badges.filter({ hasText: "LQR" })).toHaveText("LQRon the floor");
  await expect(badges.filter({ hasText: "LQR" })).toHaveClass("bad");
  await expect(badges.filter({ hasText: "LPV MPC" })).toContainText("converged");
  const boxes = await page.locator("#alert, #status > div").evaluateAll((all) => all.map((element) => element.getBoundingClientRect().toJSON() as DOMRect));
  for (const [i, box] of boxes.entries()) {
    for (const other of boxes.slice(i + 1)) expect(Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top)).toBeLessThanOrEqual(0);
  }
});

test("where the program for another controller cannot be loaded, the page says so and goes on", async ({ page }) => {
  await openFlat(page);
  const toml = await saved(page, "Save TOML");
  await openFile(page, "endless.toml", endless(toml));
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("200");
  await page.route("**/worker*.js", (route) => route.abort());
  await page.locator("#play").click();
  await expect(page.locator("#message")).toContainText("program cannot be loaded");
  await openFile(page, "drive.toml", toml);
  await expect(page.locator("#message")).toContainText("program cannot be loaded");
  expect(await saved(page, "Save TOML")).toContain("horizon = 200");
  await page.unroute("**/worker*.js");
  await openFile(page, "drive.toml", toml);
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("20");
  await page.locator("#play").click();
  await until(page, 0.3);
});

test("looked back at, a robot stands until it fell", () => {
  const history = new History(1, 0.05, 0.4);
  const rows = new Float64Array(20 * ROW_WIDTH);
  for (let i = 0; i < 20; i++) rows[i * ROW_WIDTH + ROW.time] = 0.05 * i;
  const rest = { motors: new Float64Array(60), statuses: [{ from: 0, text: "solved" }], prediction: [], activeBounds: [], ending: "fallen" };
  history.add({ ...rest, rows, now: Float64Array.from([1, 0, 2, 0, 0, 0]), down: true });
  expect([undefined, 0.5, 1, 3].map((at) => stateOf(history, at))).toEqual([
    { text: "on the floor", isGood: false }, { text: "solved", isGood: true }, { text: "on the floor", isGood: false }, { text: "on the floor", isGood: false },
  ]);
  const lines = [{ label: "LQR", colour: "", history }];
  expect([undefined, 0.5, 1].map((at) => endingsInWords(lines, at))).toEqual(["LQR: fallen", "", "LQR: fallen"]);
});

test("the camera follows the robots that stand, and nobody's fall", () => {
  const standing = { endedAt: undefined };
  const fallen = { endedAt: 4 };
  const at = (x: number, y: number) => ({ x, y, leanX: 0, leanY: 0 });
  const last = { x: 7, y: 7 };
  expect(followed([standing, standing], [at(1, 0), at(3, 2)], 5, last)).toEqual({ x: 2, y: 1 });
  expect(followed([standing, fallen], [at(1, 0), at(300, 2)], 5, last)).toEqual({ x: 1, y: 0 });
  expect(followed([standing, standing], [at(1, 0), at(NaN, 2)], 5, last)).toEqual({ x: 1, y: 0 });
  expect(followed([fallen], [at(300, 2)], 5, last)).toEqual(last);
  // Whoever looks back sees those stand that fell later.
  expect(followed([standing, fallen], [at(1, 0), at(3, 2)], 3, last)).toEqual({ x: 2, y: 1 });
});

test("where the clock is coarse the time per step is a mean", async ({ page }) => {
  // A host that does not isolate the page.
  await page.route("**/*", async (route) => {
    const response = await route.fetch();
    const headers = Object.fromEntries(Object.entries(response.headers()).filter(([name]) => !name.startsWith("cross-origin")));
    await route.fulfill({ response, headers });
  });
  await openFlat(page);
  expect(await page.evaluate(() => crossOriginIsolated)).toBe(false);
  await fill(page, "Target X", "0.5");
  await until(page, 4);
  await pause(page);
  const shown = (await page.locator("#status .time").textContent()) ?? "";
  expect(shown).toContain("(mean; coarse clock)");
  const steps = (table(await saved(page, "Save CSV"))["step_us"] ?? []).filter(Number.isFinite);
  const mean = parseFloat(shown.replace(/^\D*/, ""));
  expect(mean).toBeGreaterThan(0);
  expect(mean).toBeLessThan(1000);
  expect(steps.length).toBeGreaterThan(50);
});
