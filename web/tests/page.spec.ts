// The page itself: it loads, it fits, it does without WebGL, it does not grow.

import { readFileSync } from "node:fs";
import { expect, type Page } from "@playwright/test";
import config from "../vite.config";
import { clock, fragment, open, openAt, openFile, openFlat, openSlowly, pause, saved, settled, test, until } from "./page";

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

test("the picture from above that was asked for is no fault of WebGL", async ({ page }) => {
  await openAt(page, "./?flat");
  await expect(page.locator("body")).toHaveClass(/view-2d/);
  await expect(page.locator("#message")).toBeHidden();
});

test("the scene shows the wheels where the set-up has them", async ({ page }) => {
  // On a busy machine the view would save drawing from some frame on: here no time passes between frames.
  await page.addInitScript(() => (performance.now = () => 0));
  await open(page);
  const toml = await saved(page, "Save TOML");
  const box = await page.locator("#scene").boundingBox();
  if (!box) throw new Error("no scene");
  // The robot alone.
  const clip = { x: box.x + box.width * 0.3, y: box.y + box.height * 0.4, width: box.width * 0.4, height: box.height * 0.3 };
  const picture = async (title: string, lines: string): Promise<Buffer> => {
    const titled = toml.replace(/^title = .*$/m, `title = "${title}"`);
    await openFile(page, "mine.toml", titled.replace("gravity_m_s2 = 9.81", `gravity_m_s2 = 9.81\n${lines}`));
    await expect(page.locator("#title")).toHaveText(title);
    await settled(page);
    return page.screenshot({ clip });
  };
  const paper = await picture("paper", "");
  expect((await picture("said", "wheel_azimuths_deg = [-90.0, 30.0, 150.0]")).equals(paper)).toBe(true);
  expect((await picture("turned", "wheel_azimuths_deg = [0.0, 120.0, 240.0]")).equals(paper)).toBe(false);
});

test("the words of the page are explained beside a picture", async ({ page }) => {
  await openFlat(page);
  const dialog = page.getByRole("dialog", { name: "What is what" });
  await expect(dialog).toBeHidden();
  await page.getByRole("button", { name: "What is what" }).click();
  await expect(dialog.getByRole("img", { name: /phi.*theta/ })).toBeVisible();
  for (const word of ["phi", "theta", "LPV MPC", "active bound"]) await expect(dialog.locator("dt", { hasText: word }).first()).toBeVisible();
  await dialog.getByRole("button", { name: "Close" }).click();
  await expect(dialog).toBeHidden();
  const meanings = await page.locator("#plots figcaption").evaluateAll((all) => all.map((caption) => (caption as HTMLElement).title));
  expect(meanings.every((meaning) => meaning.length > 10)).toBe(true);
});

test("the licences name what the page is made of, crates included", async ({ page }) => {
  const response = await page.request.get("./licences.txt");
  const text = await response.text();
  for (const name of ["three ", "uplot ", "smol-toml ", "nalgebra ", "serde ", "wasm-bindgen ", "ode_solvers ", "standard library"]) {
    expect(text).toContain(name);
  }
});

test("the program sends the page packed, and only once", async ({ page }) => {
  const sent: Promise<Record<string, string>>[] = [];
  page.on("response", (response) => {
    if (/\.(js|wasm|css)$/.test(response.url())) sent.push(response.allHeaders());
  });
  await openAt(page, "./?flat");
  expect(sent.length).toBeGreaterThanOrEqual(3);
  for (const headers of await Promise.all(sent)) {
    expect(headers["content-encoding"]).toMatch(/^(br|gzip)$/);
    expect(headers["etag"]).toMatch(/^"[0-9a-f]{64}"$/);
  }
});

test("the preview of the build isolates the page as the program does", () => {
  const { preview, server } = config as { preview: { headers: object }; server: { headers: object } };
  for (const { headers } of [preview, server]) {
    expect(headers).toMatchObject({ "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp" });
  }
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
  // A slider and the robot are seen together.
  const slider = page.getByLabel("Horizon N, slider");
  await slider.evaluate((element) => element.scrollIntoView({ block: "end" }));
  await expect(slider).toBeInViewport();
  await expect(page.locator("#scene canvas")).toBeInViewport({ ratio: 0.9 });
  const [scene, field] = [await page.locator(".stage").boundingBox(), await slider.boundingBox()];
  expect(field?.y ?? NaN).toBeGreaterThan((scene?.y ?? NaN) + (scene?.height ?? NaN));
  expect(problems).toEqual([]);
  await context.close();
});

/** Bytes that a program holds, by a snapshot of its heap: objects, numbers, texts, arrays, WebAssembly
 *  memories. Not what the engine keeps of its own, within its bounds, while a page is new: compiled code,
 *  the shapes of texts it has drawn, notes of frames that took long. */
function held(snapshot: string): number {
  const { snapshot: { meta }, nodes, strings } = JSON.parse(snapshot) as {
    snapshot: { meta: { node_fields: string[]; node_types: [string[]] } }; nodes: number[]; strings: string[];
  };
  const place = (field: string) => meta.node_fields.indexOf(field);
  const [type, name, size] = [place("type"), place("name"), place("self_size")];
  let bytes = 0;
  for (let i = 0; i < nodes.length; i += meta.node_fields.length) {
    const isOfTheEngine = ["code", "native", "synthetic"].includes(meta.node_types[0][nodes[i + type] ?? 0] ?? "");
    const isMemory = strings[nodes[i + name] ?? 0] === "system / JSArrayBufferData";
    if (!isOfTheEngine || isMemory) bytes += nodes[i + size] ?? 0;
  }
  return bytes;
}

/** What the page and its worker hold, bytes, and how many nodes the page's document has. */
async function memoryOf(page: Page): Promise<() => Promise<[page: number, worker: number, nodes: number]>> {
  const session = await page.context().newCDPSession(page);
  const attached = new Promise<string>((resolve) => session.on("Target.attachedToTarget", ({ sessionId }) => resolve(sessionId)));
  await session.send("Target.setAutoAttach", { autoAttach: true, waitForDebuggerOnStart: false, flatten: false });
  const sessionId = await attached;
  let parts: string[] = [];
  session.on("HeapProfiler.addHeapSnapshotChunk", ({ chunk }) => parts.push(chunk));
  // The worker's answers come in messages of the page's session.
  let answered = () => {};
  session.on("Target.receivedMessageFromTarget", ({ message }) => {
    const { id, params } = JSON.parse(message) as { id?: number; params?: { chunk?: string } };
    if (params?.chunk !== undefined) parts.push(params.chunk);
    if (id !== undefined) answered();
  });
  const ofPage = () => session.send("HeapProfiler.takeHeapSnapshot").then(() => {});
  const ofWorker = () => new Promise<void>((resolve, reject) => {
    answered = resolve;
    const message = JSON.stringify({ id: 1, method: "HeapProfiler.takeHeapSnapshot" });
    session.send("Target.sendMessageToTarget", { sessionId, message }).catch(reject);
  });
  const take = async (snapshot: () => Promise<void>) => {
    parts = [];
    await snapshot();
    return held(parts.join(""));
  };
  return async () => [await take(ofPage), await take(ofWorker), (await session.send("Memory.getDOMCounters")).nodes];
}

test("minutes do not let the memory grow", async ({ page }) => {
  test.setTimeout(200_000);
  // It goes on and on.
  const toml = readFileSync("../crates/ballbot-scenario/src/builtin/lissajous.toml", "utf8").replace(/^duration_s = .*$/m, "duration_s = 3600");
  const problems = await openSlowly(page, `./#${fragment(toml)}`);
  // Sixteen times as many samples as the page offers.
  await page.locator("#speed").evaluate((select: HTMLSelectElement) => select.add(new Option("16", "16")));
  await page.locator("#speed").selectOption("16");
  await page.locator("#play").click();
  // The way behind the ball is as long as it gets.
  await until(page, 60);
  const memory = await memoryOf(page);
  // While it stands still nothing is on its way between worker and page.
  await pause(page);
  const before = await memory();
  const begun = await clock(page);
  await page.locator("#play").click();
  // Without looking: what a test looks at stays in the memory for a while.
  await page.waitForTimeout(45_000);
  await until(page, begun + 300);
  await pause(page);
  let after = await memory();
  // What waits to be collected on a busy machine is no growth: a leak stays, however often one looks.
  for (let looks = 1; looks < 3 && after.some((bytes, i) => bytes - (before[i] ?? 0) >= 50_000); looks += 1) {
    await page.waitForTimeout(2_000);
    after = await memory();
  }
  test.info().annotations.push({ type: "memory", description: `${before} bytes and nodes at first, ${after} after ${await clock(page) - begun} s` });
  expect(after[0] - before[0]).toBeLessThan(50_000);
  expect(after[1] - before[1]).toBeLessThan(50_000);
  // Fewer than one per frame.
  expect(after[2] - before[2]).toBeLessThan(200);
  expect(problems).toEqual([]);
});
