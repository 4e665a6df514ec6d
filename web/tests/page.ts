// What the tests do with the page, in a user's words.

import { readFile } from "node:fs/promises";
import { deflateRawSync } from "node:zlib";
import { expect, test as plain, type Page } from "@playwright/test";

/** Milliseconds by which every message between page and worker comes late, if asked for: what happens
 *  to be in time on a quick machine is late then. */
const LATENCY = Number(process.env["LATENCY"] ?? 0);

export const test = plain.extend({
  context: async ({ context }, use) => {
    if (LATENCY > 0) await context.addInitScript(delayMessages, LATENCY);
    await use(context);
  },
});

function delayMessages(latency: number): void {
  window.Worker = class extends Worker {
    override postMessage(message: unknown): void {
      setTimeout(() => super.postMessage(message), latency);
    }

    override set onmessage(take: (event: MessageEvent) => void) {
      super.onmessage = (event) => void setTimeout(() => take(event), latency);
    }
  };
}

/** Opens the page, with ten pictures a second: they keep the processor, which draws for these
 *  tests, busy enough. The returned list fills with everything that goes wrong in the page. */
export async function open(page: Page): Promise<string[]> {
  return openSlowly(page, "./");
}

export async function openSlowly(page: Page, address: string): Promise<string[]> {
  await page.addInitScript(() => {
    const frame = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (callback) => window.setTimeout(() => frame(callback), 100);
    window.cancelAnimationFrame = (id) => window.clearTimeout(id);
  });
  return openAt(page, address);
}

/** Opens the page with the picture from above, which is drawn in no time. For what has nothing to
 *  do with the picture. */
export async function openFlat(page: Page): Promise<string[]> {
  return openAt(page, "./?flat");
}

/** The browser says this when it fetches the picture from the WebGL that the processor computes. */
const FETCHES_PICTURE = "GPU stall due to ReadPixels";

export async function openAt(page: Page, address: string): Promise<string[]> {
  const problems: string[] = [];
  page.on("console", (message) => {
    const bad = message.type() === "error" || message.type() === "warning";
    if (bad && !message.text().includes(FETCHES_PICTURE)) problems.push(message.text());
  });
  page.on("pageerror", (error) => problems.push(error.message));
  page.on("request", (request) => {
    const { protocol, hostname } = new URL(request.url());
    const own = hostname === "127.0.0.1" || protocol === "blob:" || protocol === "data:";
    if (!own) problems.push(`loads ${request.url()}`);
  });
  await page.goto(address);
  await ready(page);
  return problems;
}

export async function ready(page: Page): Promise<void> {
  await page.waitForFunction(() => document.documentElement.dataset["ready"] === "true");
  await settled(page);
}

/** Waits until everything that was asked for is taken in or refused, and what came of it is seen. */
export async function settled(page: Page): Promise<void> {
  await expect(page.locator("html")).toHaveAttribute("data-settled", "true");
}

export async function scenario(page: Page, name: string): Promise<void> {
  await page.getByLabel("Scenario", { exact: true }).selectOption(name);
  await settled(page);
  await expect(page.locator("#clock")).toHaveText("0.00 s");
}

export async function clock(page: Page): Promise<number> {
  return parseFloat((await page.locator("#clock").textContent()) ?? "");
}

/** Waits until the simulated time is at least `seconds`. */
export async function until(page: Page, seconds: number): Promise<void> {
  await expect.poll(() => clock(page), { timeout: 90_000, intervals: [100] }).toBeGreaterThanOrEqual(seconds);
}

/** Waits until so many seconds of simulated time have passed since now. */
export async function pass(page: Page, seconds: number): Promise<void> {
  await until(page, (await clock(page)) + seconds);
}

/** Pauses the run, and waits until its last samples have come. */
export async function pause(page: Page): Promise<void> {
  const play = page.locator("#play");
  await expect(play).toHaveText("Pause");
  await play.click();
  await settled(page);
  await expect(play).toHaveText("Run");
}

/** Clears the line of messages, so that what is said next is new. */
export async function clearMessage(page: Page): Promise<void> {
  await page.locator("#message").evaluate((line) => line.replaceChildren());
}

/** Does several things in one go, before any of them can be answered: presses `#button`, or gives a
 *  field of the panel a value. */
export async function atOnce(page: Page, acts: [what: string, value?: string][]): Promise<void> {
  await page.evaluate((all) => {
    for (const [what, value] of all) {
      if (value === undefined) {
        document.querySelector<HTMLElement>(what)?.click();
        continue;
      }
      const labels = [...document.querySelectorAll<HTMLLabelElement>(".panel label")];
      const field = labels.find(({ textContent }) => textContent === what)?.control as HTMLInputElement;
      field.value = value;
      for (const kind of ["input", "change"]) field.dispatchEvent(new Event(kind, { bubbles: true }));
    }
  }, acts);
}

export async function openSection(page: Page, title: string): Promise<void> {
  const details = page.locator("details", { has: page.locator("summary", { hasText: new RegExp(`^${title}$`) }) });
  if (!(await details.evaluate((element: HTMLDetailsElement) => element.open))) await details.locator("summary").click();
}

/** Types into a number field of the panel. */
export async function fill(page: Page, label: string, value: string): Promise<void> {
  const field = page.locator(".panel").getByLabel(label, { exact: true });
  await field.fill(value);
  await field.press("Enter");
  await field.blur();
  await settled(page);
}

/** The strength of the push that buttons give, rad/s, typed in the page's unit. */
export async function setPush(page: Page, strength: number): Promise<void> {
  await fill(page, "Push", String((strength * 180) / Math.PI));
}

/** The content of what a button saves. */
export async function saved(page: Page, button: string): Promise<string> {
  const download = page.waitForEvent("download");
  await page.getByRole("button", { name: button }).click();
  return readFile(await (await download).path(), "utf8");
}

/** What stands behind the # for a set-up. */
export function fragment(toml: string): string {
  return `1.${deflateRawSync(JSON.stringify({ toml, robots: ["lpv"] })).toString("base64url")}`;
}

/** Chooses a file in the dialogue of the button "Open". */
export async function openFile(page: Page, name: string, text: string): Promise<void> {
  const chooser = page.waitForEvent("filechooser");
  await page.getByRole("button", { name: "Open" }).click();
  await (await chooser).setFiles({ name, mimeType: "text/plain", buffer: Buffer.from(text) });
}

/** Drops files on the page. */
export async function drop(page: Page, files: [name: string, text: string][]): Promise<void> {
  await page.evaluate((dropped) => {
    const data = new DataTransfer();
    for (const [name, text] of dropped) data.items.add(new File([text], name, { type: "text/plain" }));
    const scene = document.getElementById("scene");
    scene?.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
  }, files);
}

export interface Table {
  [column: string]: number[];
}

/** The numbers of a trajectory; an empty cell is NaN. */
export function table(csv: string): Table {
  const [header, ...lines] = csv.trimEnd().split("\n");
  const columns = (header ?? "").split(",");
  const cells = lines.map((line) => line.split(","));
  return Object.fromEntries(
    columns.map((name, i) => [name, cells.map((row) => (row[i] === "" ? NaN : Number(row[i])))]),
  );
}

export function largest(values: number[] | undefined): number {
  return Math.max(...(values ?? []).filter(Number.isFinite).map(Math.abs));
}
