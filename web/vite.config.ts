import { defineConfig } from "vitest/config";

// Relative URLs, so that the viewer works below a sub-path of a reverse proxy. No inlined data and no module preload
// helper: the page's content security policy allows only files of its own origin.
export default defineConfig({
  base: "./",
  build: {
    target: "es2022",
    outDir: "dist",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: false,
    cssCodeSplit: false,
    reportCompressedSize: true,
  },
  server: {
    proxy: {
      "/v1": process.env["POINTWRIGHT_URL"] ?? "http://127.0.0.1:8080",
    },
  },
  test: {
    include: ["test/**/*.test.ts"],
    environment: "node",
  },
});
