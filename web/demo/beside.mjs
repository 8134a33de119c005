// Several pictures in rows as one JPEG: what the README and the figures show.
import { readFileSync } from "node:fs";
import { launchBrowser } from "../scripts/browser.mjs";

const WIDTH = 1400;

/** Writes rows of PNG files, all of one size (`aspect` = width / height) and as many in each row, as one picture. */
export async function putTogether(rows, aspect, out) {
  const columns = rows[0].length;
  const height = Math.floor((WIDTH * rows.length) / columns / aspect);
  const browser = await launchBrowser();
  try {
    const page = await browser.newPage({ viewport: { width: WIDTH, height } });
    const image = (file) =>
      `<img src="data:image/png;base64,${readFileSync(file).toString("base64")}" style="width:${100 / columns}%;display:block">`;
    const row = (files) => `<div style="display:flex">${files.map(image).join("")}</div>`;
    await page.setContent(`<body style="margin:0">${rows.map(row).join("")}</body>`);
    await page.screenshot({ path: out, type: "jpeg", quality: 88 });
  } finally {
    await browser.close();
  }
}
