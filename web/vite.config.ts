import { defineConfig } from "vite";

export default defineConfig({
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
