// The page itself: it loads, it fits, it does without WebGL, it does not grow.

import { expect, test, type Page } from "@playwright/test";
import { open, scenario, until } from "./page";

test("the page loads without an error and only from its own host", { tag: "@3d" }, async ({ page }) => {
  const problems = await open(page);
  await page.locator("#play").click();
  await until(page, 1);
  await expect(page.locator("#status")).toContainText("solved");
  expect(problems).toEqual([]);
});

test("it works under any path of a host", async ({ page }) => {
  // The same files, below a folder.
  await page.route("**/some/where/**", async (route) => {
    const url = new URL(route.request().url());
    const response = await route.fetch({ url: `${url.origin}${url.pathname.replace("/some/where", "")}` });
    await route.fulfill({ response });
  });
  await open(page, "./some/where/?flat");
  await page.locator("#play").click();
  await until(page, 0.5);
});

test("without WebGL the floor is shown from above, and the page says so", async ({ page }) => {
  await page.addInitScript(() => {
    const original = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
      return kind.startsWith("webgl") ? null : Reflect.apply(original, this, [kind, ...rest]);
    } as typeof original;
  });
  await page.goto("./");
  await expect(page.locator("#message")).toContainText("No WebGL");
  await expect(page.locator("body")).toHaveClass(/view-2d/);
  await page.locator("#play").click();
  await until(page, 1);
});

test("without the module the page says so, and nothing can be started", async ({ page }) => {
  await page.route("**/*.wasm", (route) => route.abort());
  await page.goto("./?flat");
  await expect(page.locator("#message")).toContainText("WebAssembly module cannot be loaded");
  await expect(page.locator("#play")).toBeDisabled();
});

test("on a phone nothing sticks out and everything can be reached", { tag: "@3d" }, async ({ browser }) => {
  const context = await browser.newContext({ viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true });
  const page = await context.newPage();
  const problems = await open(page);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  expect(overflow).toBeLessThanOrEqual(0);
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  await page.touchscreen.tap(box.x + box.width * 0.8, box.y + box.height * 0.8);
  await until(page, 1);
  expect(Math.abs(Number(await page.getByLabel("Target X", { exact: true }).inputValue()))).toBeGreaterThan(0.05);
  await page.getByLabel("Horizon N", { exact: true }).scrollIntoViewIfNeeded();
  await expect(page.getByLabel("Horizon N", { exact: true })).toBeVisible();
  expect(problems).toEqual([]);
  await context.close();
});

/** Bytes of the page and its worker, after a collection. */
async function memory(page: Page): Promise<number> {
  return page.evaluate(async () => {
    const measure = (performance as unknown as { measureUserAgentSpecificMemory(): Promise<{ bytes: number }> });
    return (await measure.measureUserAgentSpecificMemory()).bytes;
  });
}

test("sixty seconds do not let the memory grow", { tag: "@3d" }, async ({ page }) => {
  test.setTimeout(200_000);
  // Small: it is the time that counts, not the picture.
  await page.setViewportSize({ width: 700, height: 420 });
  const problems = await open(page);
  await scenario(page, "lissajous");
  await page.locator("#play").click();
  await until(page, 5);
  const before = await memory(page);
  await until(page, 62);
  const after = await memory(page);
  test.info().annotations.push({ type: "memory", description: `${before} bytes at 5 s, ${after} at 62 s` });
  // A megabyte of play for what the collector has not come to.
  expect(after - before).toBeLessThan(1_000_000);
  expect(problems).toEqual([]);
});
