import { defineConfig, type LaunchOptions } from "@playwright/test";

const port = 8018;
/** What depends on the clock of the machine. */
const CLOCK = "timing.spec.ts";
/** What needs the picture in three dimensions. */
const SOLID = /@3d/;
/** WebGL, computed by the processor. Also the page is then put together that way, which takes three
 *  times as long as without. */
const WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

/** The system's Chromium. */
function chromium(args: string[]): LaunchOptions {
  return {
    executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--disable-dev-shm-usage", ...args],
  };
}

export default defineConfig({
  testDir: "tests",
  timeout: 120_000,
  // Most of a test is waiting: for simulated time to pass.
  workers: 3,
  reporter: [["list"]],
  // On a busy machine an answer may take its time.
  expect: { timeout: 15_000 },
  projects: [
    { name: "3d", testIgnore: CLOCK, grep: SOLID, fullyParallel: true, use: { launchOptions: chromium(WEBGL) } },
    { name: "flat", testIgnore: CLOCK, grepInvert: SOLID, fullyParallel: true, use: { launchOptions: chromium(["--disable-gpu"]) } },
    { name: "timing", testMatch: CLOCK, dependencies: ["3d", "flat"], use: { launchOptions: chromium(WEBGL) } },
  ],
  use: {
    baseURL: `http://127.0.0.1:${port}/`,
    // Not large, since the processor computes the pictures.
    viewport: { width: 1100, height: 640 },
  },
  // The program itself serves the page: what is tested is what a user gets.
  webServer: {
    command: `${process.env["BALLBOT"] ?? "../target/release/ballbot"} view --port ${port}`,
    url: `http://127.0.0.1:${port}/`,
    reuseExistingServer: false,
  },
});
