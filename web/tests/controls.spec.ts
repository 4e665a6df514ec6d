// Every control does what it says: the set-up that is saved has its value, and the run shows it.

import { expect } from "@playwright/test";
import { atOnce, fill, largest, openFile, openFlat, openSection, pass, saved, scenario, settled, table, test, until } from "./page";

const NUMBERS: [section: string, label: string, typed: string, key: string, value: number][] = [
  ["Controller", "Horizon N", "35", "horizon", 35],
  ["Controller", "Sampling t_s", "20", "t_s", 0.02],
  ["Controller", "R", "500", "r", 500],
  ["Controller", "Sub-steps", "4", "substeps", 4],
  ["World", "Slope x", "2", "slope_x_deg", 2],
  ["World", "Slope y", "-1", "slope_y_deg", -1],
  ["World", "Delay", "12", "transport_s", 0.012],
  ["World", "Noise, rates", "0.1", "noise_rad_s", (0.1 * Math.PI) / 180],
  ["World", "b1 factor", "1.05", "b1_factor", 1.05],
  ["World", "b2 factor", "0.99", "b2_factor", 0.99],
  ["World", "b3 factor", "1.02", "b3_factor", 1.02],
  ["World", "b4 factor", "0.8", "b4_factor", 0.8],
  ["World", "l factor", "0.98", "centre_of_mass_factor", 0.98],
  ["World", "Torque limit", "2", "limit_nm", 2],
  ["On a real robot", "Known delay", "15", "delay_s", 0.015],
  ["Controller", "QPs", "2", "most", 2],
  ["World", "Seed", "1234567", "seed", 1234567],
];

test("numbers go into the set-up", async ({ page }) => {
  const problems = await openFlat(page);
  for (const [section, label, typed, key, value] of NUMBERS) {
    await openSection(page, section);
    await fill(page, label, typed);
    const toml = await saved(page, "Save TOML");
    const found = [...toml.matchAll(new RegExp(`^${key} = (.*)$`, "gm"))].map(([, number]) => Number(number));
    expect(found.some((number) => Math.abs(number - value) < 1e-12), `${label}: ${found}`).toBe(true);
    await expect(page.locator(".panel").getByLabel(label, { exact: true })).toHaveValue(typed);
  }
  for (const [i, name] of ["phi", "theta", "phi_dot", "theta_dot"].entries()) await fill(page, `Q ${name}`, String(i + 2));
  expect(await saved(page, "Save TOML")).toContain("q = [2, 3, 4, 5]");
  await page.getByLabel("Terminal", { exact: true }).selectOption("equality");
  expect(await saved(page, "Save TOML")).toContain('terminal = "equality"');
  expect(problems).toEqual([]);
});

test("weights that a scenario leaves out are shown, and one of them can be changed", async ({ page }) => {
  const problems = await openFlat(page);
  await scenario(page, "one-metre");
  await openSection(page, "Controller");
  const field = page.locator(".panel").getByLabel("Q theta", { exact: true });
  expect(Number(await field.inputValue())).toBeGreaterThan(0);
  await fill(page, "R", "500");
  expect(await saved(page, "Save TOML")).toMatch(/^r = 500$/m);
  await page.locator("#play").click();
  await until(page, 1);
  expect(problems).toEqual([]);
});

test("what is typed replaces a number that changed after its field was entered", async ({ page }) => {
  await openFlat(page);
  await openSection(page, "Controller");
  const field = page.locator(".panel").getByLabel("R", { exact: true });
  const before = await field.inputValue();
  await field.selectText();
  await atOnce(page, [["Scenario", "one-metre"]]);
  await expect(field).not.toHaveValue(before);
  await page.keyboard.type("500");
  await page.keyboard.press("Enter");
  await expect.poll(() => saved(page, "Save TOML")).toMatch(/^r = 500$/m);
});

test("predictor, estimator, moves, torque rate and motors go into the set-up", async ({ page }) => {
  const problems = await openFlat(page);
  await scenario(page, "two-setpoints");
  const panel = page.locator(".panel");
  await panel.getByLabel("Predictor", { exact: true }).selectOption("exact");
  expect(await saved(page, "Save TOML")).toContain("[controller.predictor.exact]");
  await fill(page, "Sub-steps", "3");
  expect(await saved(page, "Save TOML")).toMatch(/\[controller.predictor.exact\]\nsubsteps = 3/);
  await fill(page, "Sub-steps", "");
  expect(await saved(page, "Save TOML")).not.toContain("substeps");
  await panel.getByLabel("Predictor", { exact: true }).selectOption("rk4");
  await expect(panel.getByLabel("Sub-steps", { exact: true })).toHaveValue("1");
  await panel.getByLabel("Predictor", { exact: true }).selectOption("stage_consistent");
  await openSection(page, "On a real robot");
  await expect(panel.getByLabel("Noise phi", { exact: true })).toBeHidden();
  // The torque's rate makes a fifth state, for which the scenario's own terminal cost is none.
  await panel.getByLabel("Terminal", { exact: true }).selectOption("discrete_riccati");
  for (const label of ["Estimator (Kalman filter)", "Set points as smooth moves", "Bounded torque rate", "Motor limits known"]) {
    await panel.getByLabel(label, { exact: true }).check();
  }
  await panel.getByLabel("Units", { exact: true }).selectOption("radians");
  await fill(page, "Noise phi", "0.002");
  await panel.getByLabel("Finds", { exact: true }).selectOption("none");
  await fill(page, "Ball speed", "5");
  await fill(page, "Rate limit", "30");
  await fill(page, "Each motor", "1.5");
  const toml = await saved(page, "Save TOML");
  for (const line of ["phi_noise_rad = 0.002", 'disturbances = "none"', "phi_dot_rad_s = 5", "limit_nm_s = 30", "limit_nm = 1.5"]) {
    expect(toml).toContain(line);
  }
  await page.locator("#play").click();
  await until(page, 2);
  await expect(page.locator("#alert")).toBeHidden();
  await panel.getByLabel("Estimator (Kalman filter)", { exact: true }).uncheck();
  expect(await saved(page, "Save TOML")).not.toContain("controller.estimator");
  // Two planes on shared motors are one loop, which the page does not have.
  await scenario(page, "drive");
  await panel.getByLabel("Motor limits known", { exact: true }).click();
  await expect(page.locator("#message")).toContainText("two planes on shared motors");
  await expect(panel.getByLabel("Motor limits known", { exact: true })).not.toBeChecked();
  expect(problems).toEqual([]);
});

test("what a file has of a key stays when one of its numbers changes, and comes back when its kind does", async ({ page }) => {
  await openFlat(page);
  const drive = await saved(page, "Save TOML");
  const open = async (name: string, line: string) => {
    await openFile(page, "mine.toml", drive.replace(/^title = .*$/m, `title = "${name}"`).replace(/^horizon = .*$/m, `$&\n${line}`));
    await expect(page.locator("#title")).toHaveText(name);
  };
  await open("fixed", "iterations = { fixed = 2 }");
  await fill(page, "QPs", "3");
  expect(await saved(page, "Save TOML")).toMatch(/^fixed = 3$/m);
  await open("descent", "iterations = { descent = { most = 2, first = 9, tolerance = 0.01 } }");
  await fill(page, "QPs", "3");
  const toml = await saved(page, "Save TOML");
  for (const line of ["most = 3", "first = 9", "tolerance = 0.01"]) expect(toml).toContain(line);
  await open("estimator", "estimator = { disturbances = { torque_and_tilt = { torque_drift_nm = 0.05, tilt_drift_rad = 0.004 } } }");
  const finds = page.locator(".panel").getByLabel("Finds", { exact: true });
  await openSection(page, "On a real robot");
  const found = await saved(page, "Save TOML");
  expect(found).toContain("torque_and_tilt");
  await finds.selectOption("none");
  await settled(page);
  await finds.selectOption("torque_and_tilt");
  await settled(page);
  expect(await saved(page, "Save TOML")).toBe(found);
});

test("tables of one set-up are none of the next", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  expect(await saved(page, "Save TOML")).toContain("linear_model");
  await scenario(page, "drive");
  await page.locator(".panel").getByLabel("Terminal", { exact: true }).selectOption("continuous_riccati");
  await settled(page);
  expect(await saved(page, "Save TOML")).not.toContain("linear_model");
});

test("the LQR knows no bounded rate", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "single-setpoint-terminal");
  await page.locator(".panel").getByLabel("Terminal", { exact: true }).selectOption("discrete_riccati");
  await openSection(page, "On a real robot");
  await page.locator(".panel").getByLabel("Bounded torque rate", { exact: true }).check();
  await page.locator(".panel").getByLabel("LQR", { exact: true }).check();
  await page.locator(".panel").getByLabel("LPV MPC", { exact: true }).uncheck();
  await settled(page);
  const toml = await saved(page, "Save TOML");
  expect(toml).toMatch(/^horizon = 1$/m);
  expect(toml).not.toContain("torque_rate");
});

test("the guaranteed loop runs, and says where it belongs", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "far-setpoints");
  await expect(page.locator(".panel").getByLabel("Terminal", { exact: true })).toHaveValue("certified");
  await page.locator("#play").click();
  await until(page, 3);
  await expect(page.locator("#alert")).toBeHidden();
  const phi = table(await saved(page, "Save CSV"))["phi_rad"] ?? [];
  expect(phi.at(-1) ?? NaN).toBeGreaterThan(3);
  await fill(page, "Horizon N", "25");
  await pass(page, 1);
  await expect(page.locator("#alert")).toBeHidden();
  await fill(page, "Sampling t_s", "40");
  await expect(page.locator("#message")).toContainText("the certificate is for 0.05 s");
  await expect(page.getByLabel("Sampling t_s", { exact: true })).toHaveValue("50");
});

test("a slider does what its number does", async ({ page }) => {
  await openFlat(page);
  await page.getByLabel("Horizon N, slider").fill("42");
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("42");
  expect(await saved(page, "Save TOML")).toContain("horizon = 42");
  // By key, step by step, and it stays where it was moved to.
  const slider = page.getByLabel("Horizon N, slider");
  await slider.focus();
  for (let i = 0; i < 3; i++) await page.keyboard.press("ArrowRight");
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("45");
  await expect(slider).toHaveValue("45");
  const push = page.getByLabel("Push, slider");
  await push.fill("400");
  await expect(push).toHaveValue("400");
  const number = page.locator(".panel").getByLabel("Push", { exact: true });
  await expect(number).toHaveValue("400");
  // It stays when something else changes.
  await fill(page, "Horizon N", "40");
  await expect(number).toHaveValue("400");
  await fill(page, "Push", "");
  await expect(number).toHaveValue("400");
  await page.locator(".panel").getByLabel("Units", { exact: true }).selectOption("radians");
  await expect(number).toHaveValue("6.9813");
});

test("a tighter bound is kept while the robot goes on", async ({ page }) => {
  await openFlat(page);
  await scenario(page, "two-setpoints");
  await openSection(page, "Bounds");
  await page.getByLabel("torque, lower bound").fill("-0.6");
  await page.getByLabel("torque, upper bound").fill("0.6");
  await page.getByLabel("torque, upper bound").press("Enter");
  await page.locator("#play").click();
  await until(page, 3.9);
  const csv = table(await saved(page, "Save CSV"));
  expect(largest(csv["torque_nm"])).toBeLessThan(0.6 + 1e-9);
  expect(largest(csv["torque_nm"])).toBeGreaterThan(0.55);
});

test("settings change while it runs, and the robot stays where it is", async ({ page }) => {
  await openFlat(page);
  await page.locator("#play").click();
  await fill(page, "Target X", "0.5");
  await pass(page, 4);
  await fill(page, "Horizon N", "30");
  await pass(page, 2);
  await expect(page.locator("#alert")).toBeHidden();
  const csv = table(await saved(page, "Save CSV"));
  const phi = csv["phi_rad"] ?? [];
  const jump = Math.max(...phi.slice(1).map((value, i) => Math.abs(value - (phi[i] ?? value))));
  expect(jump).toBeLessThan(1.6);
  expect((phi.at(-1) ?? NaN) * 0.12).toBeCloseTo(0.5, 1);
});

test("a value that makes no sense is refused with a message, and nothing changes", async ({ page }) => {
  await openFlat(page);
  const before = await saved(page, "Save TOML");
  await fill(page, "Horizon N", "5000");
  await expect(page.locator("#message")).toContainText("controller.horizon = 5000");
  await expect(page.getByLabel("Horizon N", { exact: true })).toHaveValue("20");
  expect(await saved(page, "Save TOML")).toBe(before);
});

test("the keyboard is enough", async ({ page }) => {
  await openFlat(page);
  await page.locator("#scene").focus();
  await page.keyboard.press("ArrowRight");
  await expect(page.getByLabel("Target X", { exact: true })).toHaveValue("0.25");
  await until(page, 3);
  await page.keyboard.press("Shift+ArrowLeft");
  await page.keyboard.press(" ");
  await expect(page.locator("#play")).toHaveText("Run");
  await page.keyboard.press("r");
  await expect(page.locator("#clock")).toHaveText("0.00 s");
  await page.keyboard.press(".");
  await expect(page.locator("#clock")).toHaveText("0.05 s");
  const unnamed = await page.evaluate(() =>
    [...document.querySelectorAll("button, select, input, [role=img], [role=application]")]
      .filter((element) => {
        const input = element as HTMLInputElement;
        const name = element.getAttribute("aria-label") ?? element.textContent ?? "";
        return name.trim() === "" && (input.labels?.length ?? 0) === 0;
      })
      .map((element) => element.outerHTML),
  );
  expect(unnamed).toEqual([]);
});

test("keys of the browser are the browser's, and what is behind a dialogue is out of reach", async ({ page }) => {
  await openFlat(page);
  await page.locator("#step").click();
  await expect(page.locator("#clock")).toHaveText("0.05 s");
  await page.locator("#scene").focus();
  for (const key of ["Control+ArrowRight", "Meta+ArrowRight"]) await page.keyboard.press(key);
  await page.locator("#explain").click();
  for (const key of [".", "r"]) await page.keyboard.press(key);
  await page.keyboard.press("Escape");
  await settled(page);
  expect(await page.locator("#clock").textContent()).toBe("0.05 s");
  expect(await page.getByLabel("Target X", { exact: true }).inputValue()).toBe("0");
});

test("shortcuts go on after a click, and a field keeps its keys", async ({ page }) => {
  await openFlat(page);
  const play = page.locator("#play");
  await play.click();
  await until(page, 0.2);
  await page.keyboard.press("R");
  await expect(page.locator("#clock")).toHaveText("0.00 s");
  await page.keyboard.press(".");
  await expect(page.locator("#clock")).toHaveText("0.05 s");
  // The button has the focus: the space bar presses it, once.
  await page.keyboard.press(" ");
  await expect(play).toHaveText("Pause");
  await page.getByText("Draw path", { exact: true }).click();
  await page.keyboard.press(" ");
  await expect(play).toHaveText("Run");
  await page.keyboard.press("r");
  await expect(page.locator("#clock")).toHaveText("0.00 s");
  await page.getByLabel("Horizon N, slider").focus();
  await page.keyboard.press(".");
  await expect(page.locator("#clock")).toHaveText("0.05 s");
  await page.getByLabel("Target X", { exact: true }).focus();
  for (const key of [".", "r", " "]) await page.keyboard.press(key);
  await page.locator("#speed").focus();
  await page.keyboard.press(".");
  await settled(page);
  expect(await page.locator("#clock").textContent()).toBe("0.05 s");
  expect(await play.textContent()).toBe("Run");
});

test("what changes at every frame is not read out", async ({ page }) => {
  await openFlat(page);
  const live = "output, [aria-live]:not([aria-live=off]), [role=status], [role=alert], [role=log]";
  const read = await page.locator(live).evaluateAll((elements) => elements.map(({ id }) => id));
  expect(read).toEqual(["alert", "message"]);
  await expect(page.getByRole("group", { name: "Controllers" })).toBeVisible();
  await expect(page.getByRole("timer", { name: "Simulated time" })).toHaveText("0.00 s");
});
