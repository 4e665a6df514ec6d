// The page itself: it loads, it fits, it does without WebGL, it does not grow.

import { expect, test, type Page } from "@playwright/test";
import { clock, open, openAt, scenario, until } from "./page";

test("the page loads without an error and only from its own host", async ({ page }) => {
  const problems = await open(page);
  await page.locator("#play").click();
  await until(page, 1);
  await expect(page.locator("#status")).toContainText("converged");
  expect(problems).toEqual([]);
});

test("it works under any path of a host", async ({ page }) => {
  // The same files, below a folder.
  await page.route("**/some/where/**", async (route) => {
    const url = new URL(route.request().url());
    const response = await route.fetch({ url: `${url.origin}${url.pathname.replace("/some/where", "")}` });
    await route.fulfill({ response });
  });
  await openAt(page, "./some/where/?flat");
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

test("on a phone nothing sticks out and everything can be reached", async ({ browser }) => {
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

/** Sends a command of the DevTools protocol. */
type Send = (method: "HeapProfiler.collectGarbage" | "Runtime.getHeapUsage") => Promise<unknown>;

/** Bytes of a heap after a collection, with those of arrays and of WebAssembly memories. */
async function heap(send: Send): Promise<number> {
  await send("HeapProfiler.collectGarbage");
  const { usedSize, embedderHeapUsedSize, backingStorageSize } = (await send("Runtime.getHeapUsage")) as Record<string, number>;
  return (usedSize ?? NaN) + (embedderHeapUsedSize ?? NaN) + (backingStorageSize ?? NaN);
}

/** The least of three readings: a collection may leave something for the next one. */
async function least(read: () => Promise<number>): Promise<number> {
  return Math.min(await read(), await read(), await read());
}

/** The memory of the page and of its worker, bytes. */
async function memoryOf(page: Page): Promise<() => Promise<[page: number, worker: number]>> {
  const session = await page.context().newCDPSession(page);
  const attached = new Promise<string>((resolve) => session.on("Target.attachedToTarget", ({ sessionId }) => resolve(sessionId)));
  await session.send("Target.setAutoAttach", { autoAttach: true, waitForDebuggerOnStart: false, flatten: false });
  const sessionId = await attached;
  // The worker's answers come in messages of the page's session.
  const waiting = new Map<number, (result: unknown) => void>();
  session.on("Target.receivedMessageFromTarget", ({ message }) => {
    const { id, result } = JSON.parse(message) as { id: number; result: unknown };
    waiting.get(id)?.(result);
  });
  let id = 0;
  const toWorker: Send = (method) => new Promise((resolve, reject) => {
    waiting.set(++id, resolve);
    session.send("Target.sendMessageToTarget", { sessionId, message: JSON.stringify({ id, method }) }).catch(reject);
  });
  return async () => [await least(() => heap((method) => session.send(method))), await least(() => heap(toWorker))];
}

test("sixty seconds do not let the memory grow", async ({ page }) => {
  test.setTimeout(200_000);
  const problems = await open(page);
  await scenario(page, "lissajous");
  await page.locator("#play").click();
  await until(page, 5);
  const memory = await memoryOf(page);
  const before = await memory();
  // Without looking: what a test looks at stays in the memory for a while.
  await page.waitForTimeout(60_000);
  const after = await memory();
  test.info().annotations.push({ type: "memory", description: `${before} bytes at first, ${after} after a minute` });
  // Room for what the engine compiles and what its collector leaves for later.
  expect(after[0] - before[0]).toBeLessThan(1_000_000);
  expect(after[1] - before[1]).toBeLessThan(500_000);
  expect(await clock(page)).toBeGreaterThan(30);
  expect(problems).toEqual([]);
});
