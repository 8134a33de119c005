import type { ApiClient } from "../api/client";
import type { ImageChannel, ImageShape, RegionName, ShapeOperation } from "../api/types";
import { reportError } from "../edits/errors";
import { type MaskSettings, paintMask } from "../edits/image-mask";
import type { RegionEditor } from "../edits/regions";
import { cross, normalise } from "../math/vec3";
import { type PlaneRectangle, placeRectangle } from "../scene/view-matrix";
import type { Viewport } from "../scene/viewport";
import type { Bus, SessionStore } from "../session-store";
import { h, setText } from "./dom";
import { checkField, rangeField, selectField } from "./fields";
import { icon } from "./icons";
import { createImagePlacer, type ImagePlacer } from "./image-placer";

const CHANNELS: readonly (readonly [ImageChannel, string])[] = [
  ["luminance", "Brightness"],
  ["red", "Red"],
  ["green", "Green"],
  ["blue", "Blue"],
  ["alpha", "Opacity"],
];
const PREVIEW_PX = 240;
const PNG_SIGNATURE = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];

async function isPng(file: File): Promise<boolean> {
  const start = new Uint8Array(await file.slice(0, PNG_SIGNATURE.length).arrayBuffer());
  return PNG_SIGNATURE.every((byte, at) => start[at] === byte);
}
/** How the cloud's import report names coordinates of a texture. */
const TEXTURE_ATTRIBUTE = "texcoord";

type Use = "both" | "zero-below" | "zero-above" | "one-above" | "one-below";
const USES: readonly (readonly [Use, string])[] = [
  ["both", "Dark stays, bright moves"],
  ["one-above", "Bright moves"],
  ["one-below", "Dark moves"],
  ["zero-above", "Bright stays"],
  ["zero-below", "Dark stays"],
];

interface Chosen {
  file: File;
  bitmap: ImageBitmap;
  /** What the preview shows, at its size. */
  pixels: ImageData;
  /** The server's name of it, once it was sent. */
  id: string | null;
}

export interface ImageForm {
  element: HTMLElement;
  /** Takes the image away that lies over the view; false where none does. */
  dismiss(): boolean;
}

/**
 * Regions by the pixels of an image: laid over the view and cast along it, or by the cloud's own texture coordinates. Folding
 * the `holder` takes the image away.
 */
export function createImageForm(
  bus: Bus,
  client: ApiClient,
  store: SessionStore,
  regions: RegionEditor,
  viewport: Viewport,
  holder: HTMLDetailsElement,
): ImageForm {
  let chosen: Chosen | null = null;
  let placer: ImagePlacer | null = null;
  let use: Use = "both";
  let facing = true;
  let by: "view" | "texture" = "view";
  const mask: MaskSettings = { channel: "luminance", threshold: 0.5, side: "above" };

  const preview = h("canvas", { class: "mask-preview", role: "img" });
  const part = h("p", { class: "hint", aria: { live: "polite" } });
  const drawMask = (): void => {
    if (!chosen) return;
    const { width, height } = chosen.pixels;
    const image = new ImageData(width, height);
    // Bright is white, whichever of the two is used.
    const bright = paintMask(chosen.pixels.data, { ...mask, side: "above" }, image.data);
    const dark = paintMask(
      chosen.pixels.data,
      { ...mask, side: "below" },
      new Uint8ClampedArray(image.data.length),
    );
    preview.width = width;
    preview.height = height;
    preview.getContext("2d")?.putImageData(image, 0, 0);
    preview.setAttribute("aria-label", "The mask: white is above the threshold");
    setText(part, `${Math.round(100 * bright)} % bright, ${Math.round(100 * dark)} % dark`);
  };

  const takeAway = (): void => {
    placer?.remove();
    placer = null;
    const next = by === "view" ? "Lay the image over the view" : "Apply image";
    setText(apply, next);
  };
  /** Lays the image over the view where that is what places it; the view is looked at meanwhile, not painted. */
  const place = (): void => {
    if (!chosen || by !== "view" || !holder.open) {
      takeAway();
      return;
    }
    bus.invoke("tool.activate", "orbit");
    placer ??= createImagePlacer(viewport.canvas.parentElement ?? document.body, chosen.bitmap);
    setText(apply, "Apply image");
  };
  bus.on("tool.changed", (tool) => {
    if (tool !== "orbit") takeAway();
  });
  const drop = (): void => {
    chosen?.bitmap.close();
    chosen = null;
    controls.hidden = true;
    place();
  };
  const take = async (file: File): Promise<void> => {
    try {
      if (!(await isPng(file))) {
        bus.fire("toast", { kind: "error", title: `${file.name} is no PNG image` });
        return;
      }
      const bitmap = await createImageBitmap(file);
      drop();
      const shrink = Math.min(1, PREVIEW_PX / Math.max(bitmap.width, bitmap.height));
      const canvas = h("canvas", {
        width: Math.max(1, Math.round(bitmap.width * shrink)),
        height: Math.max(1, Math.round(bitmap.height * shrink)),
      });
      const context = canvas.getContext("2d");
      if (!context) throw new Error("This browser cannot draw the image.");
      context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
      chosen = { file, bitmap, pixels: context.getImageData(0, 0, canvas.width, canvas.height), id: null };
      setText(name, file.name);
      controls.hidden = false;
      drawMask();
      place();
    } catch (error) {
      reportError(bus, error, `${file.name} is no image that can be shown`);
    }
  };

  const input = h("input", {
    type: "file",
    accept: "image/png",
    hidden: true,
    aria: { label: "PNG image" },
    onchange: () => {
      const [file] = input.files ?? [];
      input.value = "";
      if (file) void take(file);
    },
  });
  const name = h("span", {}, "Choose a PNG…");
  const choose = h(
    "button",
    { type: "button", class: "button quiet wide", onclick: () => input.click() },
    icon("upload"),
    name,
  );
  const channel = selectField("Channel", CHANNELS, mask.channel, (value) => {
    mask.channel = value;
    drawMask();
  });
  const threshold = rangeField(
    "Threshold",
    { min: 0, max: 1, step: 0.01 },
    mask.threshold,
    (value) => value.toFixed(2),
    (value) => {
      mask.threshold = value;
      drawMask();
    },
  );
  const uses = selectField("Use", USES, use, (value) => {
    use = value;
  });
  const face = checkField("Only what faces the view", facing, (on) => {
    facing = on;
  });
  const way = selectField(
    "Placed by",
    [
      ["view", "The view: lay it over"],
      ["texture", "Texture coordinates"],
    ],
    by,
    (value) => {
      by = value;
      face.element.hidden = by === "texture";
      hint.hidden = by === "texture";
      place();
    },
  );
  way.element.hidden = true;
  void client
    .clouds()
    .then((clouds) => {
      const cloud = clouds.find(({ id }) => id === store.document.cloud);
      way.element.hidden = !cloud?.report.attributes.includes(TEXTURE_ATTRIBUTE);
    })
    // Without the list there is the view to place it by.
    .catch(() => undefined);

  /** `laid`: where the image lies over the view; null: by the texture coordinates. */
  const operation = (image: string, side: "above" | "below", laid: PlaneRectangle | null): ShapeOperation => {
    const shape: Omit<ImageShape, "projection"> = {
      type: "image",
      image,
      channel: mask.channel,
      threshold: mask.threshold,
      side,
    };
    if (!laid)
      return {
        mode: "add",
        shape: { ...shape, projection: { type: "texture", repeat: false } },
        steal: true,
      };
    const { origin, u, v } = laid;
    const projection = { type: "planar", origin: store.toModel(origin), u, v } as const;
    return {
      mode: "add",
      shape: { ...shape, projection },
      steal: true,
      ...(facing && { facing: normalise(cross(u, v)) }),
    };
  };
  const send = async (): Promise<void> => {
    const image = chosen;
    if (!image) return;
    if (by === "view" && !placer) {
      place();
      return;
    }
    // As it lies now: it may be moved while the image is sent.
    const laid = placer && placeRectangle(viewport.focusPlane(), placer.place.corner, placer.place.size);
    try {
      image.id ??= (await client.uploadImage(image.file)).id;
    } catch (error) {
      reportError(bus, error, "The image was refused");
      return;
    }
    const { id } = image;
    const changes: [RegionName, ShapeOperation][] =
      use === "both"
        ? [
            ["zero", operation(id, "below", laid)],
            ["one", operation(id, "above", laid)],
          ]
        : [
            [
              use.startsWith("zero") ? "zero" : "one",
              operation(id, use.endsWith("above") ? "above" : "below", laid),
            ],
          ];
    const document = await regions.paintEach(changes);
    if (document && document.changed > 0) takeAway();
    if (document?.changed === 0)
      bus.fire("toast", { kind: "info", title: "Nothing lies under the chosen part of the image" });
  };
  const apply = h("button", { type: "submit", class: "button" }, "Apply image");
  const hint = h(
    "p",
    { class: "hint" },
    "Drag the image over the view, size it by its corner, then apply. It is cast straight onto the surface: exact at the depth that the view turns about, shifted a little before and behind it.",
  );
  const controls = h(
    "div",
    { class: "shape-fields", hidden: true },
    preview,
    part,
    threshold.element,
    channel.element,
    uses.element,
    way.element,
    face.element,
    hint,
    apply,
  );
  const form = h(
    "form",
    {
      class: "shape-form",
      onsubmit: (event) => {
        event.preventDefault();
        void send();
      },
    },
    choose,
    input,
    controls,
  );
  holder.addEventListener("toggle", place);
  return {
    element: form,
    dismiss() {
      const laid = placer !== null;
      takeAway();
      return laid;
    },
  };
}
