import { defineConfig } from "vite";

/** As of `ballbot view`: for an isolated page browsers keep a finer clock. */
export const HEADERS = {
  "Cross-Origin-Opener-Policy": "same-origin",
  "Cross-Origin-Embedder-Policy": "require-corp",
  "Cross-Origin-Resource-Policy": "same-origin",
};

export default defineConfig({
  preview: { headers: HEADERS },
  server: { headers: HEADERS },
  // Relative addresses: the folder works under any path of any host.
  base: "./",
  build: {
    target: "es2022",
    // Nothing as a data: address, which the Content-Security-Policy would refuse.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
  },
  worker: { format: "es" },
});
