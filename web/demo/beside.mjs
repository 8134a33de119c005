// Two pictures side by side as one JPEG: the README's first look at the demonstration.
import { readFileSync } from "node:fs";
import { launchBrowser } from "../scripts/browser.mjs";

const WIDTH = 1400;

/** Writes `left` and `right` (PNG files of one size, `aspect` = width / height) beside each other to `out`. */
export async function putBeside(left, right, aspect, out) {
  const height = Math.floor(WIDTH / 2 / aspect);
  const browser = await launchBrowser();
  try {
    const page = await browser.newPage({ viewport: { width: WIDTH, height } });
    const image = (file) =>
      `<img src="data:image/png;base64,${readFileSync(file).toString("base64")}" style="width:50%;display:block">`;
    await page.setContent(`<body style="margin:0;display:flex">${image(left)}${image(right)}</body>`);
    await page.screenshot({ path: out, type: "jpeg", quality: 88 });
  } finally {
    await browser.close();
  }
}
