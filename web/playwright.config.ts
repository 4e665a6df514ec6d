import { defineConfig } from "@playwright/test";

const port = 8018;

export default defineConfig({
  testDir: "tests",
  timeout: 120_000,
  // Most of a test is waiting: for simulated time to pass.
  workers: 3,
  reporter: [["list"]],
  // On a busy machine an answer may take its time.
  expect: { timeout: 15_000 },
  projects: [
    { name: "page", testIgnore: "timing.spec.ts", fullyParallel: true },
    { name: "timing", testMatch: "timing.spec.ts", dependencies: ["page"] },
  ],
  use: {
    baseURL: `http://127.0.0.1:${port}/`,
    // Not large, since the processor computes the pictures.
    viewport: { width: 1100, height: 640 },
    launchOptions: {
      // The system's Chromium. WebGL is computed by the processor; the rest of the page is put
      // together without it, which takes half the time.
      executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
      args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"],
    },
  },
  // The program itself serves the page: what is tested is what a user gets.
  webServer: {
    command: `${process.env["BALLBOT"] ?? "../target/release/ballbot"} view --port ${port}`,
    url: `http://127.0.0.1:${port}/`,
    reuseExistingServer: false,
  },
});
