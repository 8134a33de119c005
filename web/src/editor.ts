import type { ApiClient } from "./api/client";
import type { SessionDocument } from "./api/types";
import { CommandQueue } from "./command-queue";
import { editorShortcuts } from "./editor-shortcuts";
import { reportError } from "./edits/errors";
import { HistoryEditor } from "./edits/history";
import { PaintSettingsStore } from "./edits/paint-settings";
import { Player } from "./edits/player";
import { applyRecipeFile } from "./edits/recipe";
import { RegionEditor } from "./edits/regions";
import { inScene } from "./edits/residual";
import { TransformEditor } from "./edits/transform";
import { PAINT_TARGETS, TRANSFORM_KINDS } from "./event-map";
import { FrameSource } from "./frame-source";
import { displayFromLink, type LinkState, viewHash } from "./link";
import { hasAttribute } from "./protocol/frames";
import { Gizmo } from "./scene/gizmo";
import { Viewport } from "./scene/viewport";
import { type Bus, SessionStore } from "./session-store";
import { type BrushSize, BrushTool } from "./tools/brush-tool";
import { FloodTool } from "./tools/flood-tool";
import { OrbitTool } from "./tools/orbit-tool";
import { type OutlineMethod, OutlineTool } from "./tools/outline-tool";
import { PaintTool } from "./tools/paint-tool";
import { steppedRadius } from "./tools/stroke";
import { ToolManager } from "./tools/tool-manager";
import { TransformTool } from "./tools/transform-tool";
import { createColourBar } from "./ui/colour-bar";
import { createDisplayPanel, loadDisplay, saveDisplay } from "./ui/display-panel";
import { h } from "./ui/dom";
import { createHistoryPanel } from "./ui/history-panel";
import { createLazyFold } from "./ui/lazy-fold";
import { createPaintBar } from "./ui/paint-bar";
import { createPlayback } from "./ui/playback";
import { createRegionsPanel } from "./ui/regions-panel";
import { listen } from "./ui/shortcuts";
import { createStatusBar } from "./ui/status-bar";
import { createToolbar } from "./ui/toolbar";
import { createTopBar } from "./ui/top-bar";
import { createTransformPanel } from "./ui/transform-panel";

const BRUSH_PART = 0.035;
const HASH_DELAY_MS = 250;

export interface Editor {
  viewport: Viewport;
  source: FrameSource;
  store: SessionStore;
  queue: CommandQueue;
  /** The stream's first key frame is on the screen whole. */
  loaded(): boolean;
}

/** Puts the editor of a ready session together. Modules meet on the bus; what is made here lives as long as the page. */
export function createEditor(
  root: HTMLElement,
  bus: Bus,
  client: ApiClient,
  document: SessionDocument,
  link: LinkState,
): Editor {
  const store = new SessionStore(bus, document);
  const queue = new CommandQueue();
  const stage = h("div", { class: "stage" });
  root.classList.toggle("bare", !link.ui);
  root.append(stage);
  const viewport = new Viewport(stage);
  viewport.setSpacing(document.spacing, document.sample_count);
  viewport.setPatient(!link.ui);
  const display = displayFromLink(link.mode, loadDisplay());
  viewport.setDisplay(display);

  const regions = new RegionEditor(bus, client, queue, store);
  const history = new HistoryEditor(bus, client, queue, store, regions);
  const transform = new TransformEditor(bus, client, queue, store, ({ residual, blend }) => {
    viewport.setResidual(residual && inScene(residual, (point) => store.toScene(point)), blend);
  });
  let loaded = false;
  const source = new FrameSource(
    bus,
    client,
    store,
    viewport,
    () => {
      if (link.camera) viewport.rig.setState(link.camera);
      else viewport.rig.home();
    },
    () => player.set(null),
  );
  const player = new Player(bus, store, (s) => source.showPart(s));
  bus.on("load.changed", ({ complete }) => {
    loaded = complete;
  });
  viewport.onContext = (lost) => {
    if (lost)
      bus.fire("toast", {
        kind: "info",
        title: "The graphics card was taken away",
        lines: ["The picture comes back by itself."],
      });
    else source.restart();
  };

  const size: BrushSize = { radius: document.diagonal * BRUSH_PART };
  const paint = new PaintSettingsStore(bus);
  const brush = new BrushTool(viewport, store, regions, size, paint);
  const outline = (method: OutlineMethod): OutlineTool =>
    new OutlineTool(method, bus, viewport, store, regions, size, paint);
  const gestures = {
    brush,
    lasso: outline("lasso"),
    polygon: outline("polygon"),
    rectangle: outline("rectangle"),
    ellipse: outline("ellipse"),
    line: outline("line"),
    flood: new FloodTool(bus, viewport, store, regions, paint),
  };
  const setBrush = (radius: number): void => {
    size.radius = steppedRadius(radius, 0, document.diagonal);
    bus.fire("brush.radius", size.radius);
    brush.refresh();
  };
  const stepBrush = (steps: number): void => setBrush(steppedRadius(size.radius, steps, document.diagonal));
  bus.function("brush.set", setBrush);
  bus.function("view.frame", () => viewport.rig.frame());
  const gizmo = new Gizmo(viewport);
  new ToolManager(bus, new OrbitTool(), [
    ...PAINT_TARGETS.map((target) => new PaintTool(target, bus, viewport, paint, gestures)),
    ...TRANSFORM_KINDS.map((kind) => new TransformTool(kind, bus, viewport, gizmo, store, transform)),
  ]);
  stage.addEventListener(
    "wheel",
    (event) => {
      if (!event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      stepBrush(event.deltaY < 0 ? 1 : -1);
    },
    { capture: true, passive: false },
  );

  const transformPanel = createTransformPanel(bus, document, transform);
  // How far regions grow and shrink, until a person says otherwise: what separates neighbouring samples, twice over.
  const reach = { value: 2 * document.spacing };
  const shortcuts = editorShortcuts({
    bus,
    viewport,
    editor: transform,
    transformPanel,
    stepBrush,
    command: (region, command) => void regions.command(region, command, reach.value),
  });
  let sheet: Promise<{ show(): void }> | null = null;
  bus.function("shortcuts.show", () => {
    sheet ??= import("./ui/shortcut-sheet").then(({ createShortcutSheet }) => {
      const made = createShortcutSheet(shortcuts);
      root.append(made.element);
      return made;
    });
    void sheet
      .then((made) => made.show())
      .catch((error: unknown) => {
        sheet = null;
        reportError(bus, error, "The shortcuts cannot be shown");
      });
  });
  let dismissImage = (): boolean => false;
  bus.function("image.dismiss", () => dismissImage());
  const imageFold = createLazyFold(bus, "Regions from an image", async (holder) => {
    const { createImageForm } = await import("./ui/image-form");
    const form = createImageForm(bus, client, store, regions, viewport, holder);
    dismissImage = form.dismiss;
    return form.element;
  });
  const modelFold = createLazyFold(bus, "Regions from another model", async (holder) => {
    const { createModelForm } = await import("./ui/model-form");
    return createModelForm(bus, client, store, regions, holder);
  });
  const savedFold = createLazyFold(bus, "Saved regions", async () => {
    const { createSavedRegions } = await import("./ui/saved-regions");
    return createSavedRegions(bus, store, regions);
  });
  if (link.ui) listen(shortcuts);
  root.append(
    createTopBar(bus, client, store),
    createToolbar(bus),
    createPaintBar(bus),
    h(
      "aside",
      { class: "side panel", aria: { label: "Properties" } },
      createRegionsPanel(bus, store, regions, size.radius, reach, savedFold, imageFold, modelFold),
      transformPanel.element,
      createDisplayPanel(bus, document, {
        settings: display,
        hasColor: () => source.last !== null && hasAttribute(source.last, "color"),
        up: viewport.rig.up,
        onUp: (up) => {
          viewport.rig.setUp(up);
          viewport.rig.home();
        },
      }),
      createHistoryPanel(
        bus,
        createPlayback(bus, client, store, (file) => void applyRecipeFile(bus, client, store, regions, file)),
      ),
      transformPanel.foot,
    ),
    createColourBar(bus, display),
    createStatusBar(bus, store),
  );
  bus.on("display.changed", (settings) => {
    viewport.setDisplay(settings);
    saveDisplay(settings);
    source.showLevel(settings.level);
  });
  keepLink(viewport);
  source.start();
  void history.load();
  return { viewport, source, store, queue, loaded: () => loaded };
}

/** Keeps the address bar at the view, once it rests, so that the link reopens it. */
function keepLink(viewport: Viewport): void {
  let timer = 0;
  viewport.onDrawn = () => {
    clearTimeout(timer);
    timer = window.setTimeout(() => {
      const hash = viewHash(viewport.rig.state, viewport.display);
      if (hash !== location.hash) window.history.replaceState(null, "", hash);
    }, HASH_DELAY_MS);
  };
}
