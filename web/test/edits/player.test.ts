import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { PLAY_MS, Player } from "../../src/edits/player";
import type { Notices, Questions } from "../../src/event-map";
import { Events } from "../../src/events";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

function bench() {
  const bus = new Events<Notices, Questions>();
  const shown: (number | null)[] = [];
  const player = new Player(
    bus,
    (s) => shown.push(s),
    () => Date.now(),
  );
  return { bus, shown, player };
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
