import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { SessionDocument } from "../../src/api/types";
import { PLAY_MS, Player } from "../../src/edits/player";
import type { Notices, Questions, ToolName } from "../../src/event-map";
import { Events } from "../../src/events";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

function bench() {
  const bus = new Events<Notices, Questions>();
  const shown: (number | null)[] = [];
  const state = { tool: "orbit" as ToolName, pending: false, document: { revision: 3 } as SessionDocument };
  bus.function("tool.current", () => state.tool);
  bus.function("tool.activate", (tool) => {
    state.tool = tool;
    bus.fire("tool.changed", tool);
  });
  bus.function("edit.pending", () => state.pending);
  const move = (revision: number): void => {
    state.document = { revision } as SessionDocument;
    bus.fire("session.changed", state.document);
  };
  const player = new Player(
    bus,
    state,
    (s) => shown.push(s),
    () => Date.now(),
  );
  return { bus, shown, player, state, move };
}

test("a part is shown and left again; leaving what is not shown tells nothing", () => {
  const { bus, shown } = bench();
  bus.invoke("animation.set", null);
  bus.invoke("animation.set", 0.4);
  expect(bus.invoke("animation.current")).toBe(0.4);
  bus.invoke("animation.set", null);
  expect(shown).toEqual([0.4, null]);
});

test("it plays from the start to the end, and rests there", () => {
  const { bus, shown, player } = bench();
  bus.invoke("animation.play");
  expect(player.playing).toBe(true);
  vi.advanceTimersByTime(PLAY_MS + 500);
  expect(player.playing).toBe(false);
  expect(shown[0]).toBe(0);
  expect(shown.at(-1)).toBe(1);
  expect(shown.every((s, i) => i === 0 || (s ?? 0) >= (shown[i - 1] ?? 0))).toBe(true);
  bus.invoke("animation.play");
  expect(shown.at(-1)).toBe(0);
});

test("it goes on from where it was paused", () => {
  const { bus, player } = bench();
  bus.invoke("animation.set", 0.5);
  bus.invoke("animation.play");
  vi.advanceTimersByTime(PLAY_MS / 4);
  bus.invoke("animation.play");
  expect(player.playing).toBe(false);
  expect(bus.invoke("animation.current")).toBeCloseTo(0.75, 1);
});

test("taking up a tool leaves it", () => {
  const { bus, shown } = bench();
  bus.invoke("animation.play");
  bus.fire("tool.changed", "one");
  vi.advanceTimersByTime(1000);
  expect(shown).toEqual([0, null]);
  expect(bus.invoke("animation.current")).toBeNull();
});

test("entering it lays the tool down", () => {
  const { bus, shown, state } = bench();
  bus.invoke("tool.activate", "zero");
  bus.invoke("animation.set", 0.5);
  expect(state.tool).toBe("orbit");
  expect(shown).toEqual([0.5]);
  bus.invoke("tool.activate", "move");
  expect(shown).toEqual([0.5, null]);
  bus.invoke("animation.play");
  expect(state.tool).toBe("orbit");
  expect(shown).toEqual([0.5, null, 0]);
});

test("it is not entered while an edit is pending, and left where one begins", () => {
  const { bus, shown, state, player } = bench();
  state.pending = true;
  bus.invoke("animation.set", 0.5);
  bus.invoke("animation.play");
  expect(player.playing).toBe(false);
  expect(shown).toEqual([]);
  state.pending = false;
  bus.invoke("animation.set", 0.5);
  state.pending = true;
  bus.fire("transform.changed", {} as Notices["transform.changed"]);
  expect(shown).toEqual([0.5, null]);
});

test("any change of the session leaves it, the same session told again does not", () => {
  const { bus, shown, move, player } = bench();
  bus.invoke("animation.set", 0.5);
  move(3);
  expect(shown).toEqual([0.5]);
  move(4);
  expect(shown).toEqual([0.5, null]);
  bus.invoke("animation.play");
  move(4);
  expect(player.playing).toBe(true);
  move(5);
  expect(player.playing).toBe(false);
  expect(bus.invoke("animation.current")).toBeNull();
});
