import { expect, test } from "vitest";
import { Events } from "../src/events";

interface Notices {
  counted: number;
}
interface Questions {
  sum: (a: number, b: number) => number;
}

test("a notice reaches every listener until it stops listening", () => {
  const bus = new Events<Notices, Questions>();
  const heard: number[] = [];
  const stop = bus.on("counted", (value) => heard.push(value));
  bus.on("counted", (value) => heard.push(10 * value));
  bus.fire("counted", 1);
  stop();
  bus.fire("counted", 2);
  expect(heard).toEqual([1, 10, 20]);
});

test("a listener that throws keeps no other from hearing, and its error comes out", () => {
  const bus = new Events<Notices, Questions>();
  const heard: number[] = [];
  bus.on("counted", () => {
    throw new Error("broken listener");
  });
  bus.on("counted", (value) => heard.push(value));
  expect(() => bus.fire("counted", 3)).toThrow("broken listener");
  expect(heard).toEqual([3]);
});

test("a listener that is added while a notice goes round hears the next one", () => {
  const bus = new Events<Notices, Questions>();
  const heard: number[] = [];
  bus.on("counted", (value) => {
    if (value === 1) bus.on("counted", (later) => heard.push(later));
  });
  bus.fire("counted", 1);
  expect(heard).toEqual([]);
  bus.fire("counted", 2);
  expect(heard).toEqual([2]);
});

test("a question has exactly one answerer", () => {
  const bus = new Events<Notices, Questions>();
  expect(() => bus.invoke("sum", 1, 2)).toThrow(/nobody answers/);
  const end = bus.function("sum", (a, b) => a + b);
  expect(bus.invoke("sum", 1, 2)).toBe(3);
  expect(() => bus.function("sum", () => 0)).toThrow(/answered already/);
  end();
  bus.function("sum", () => 7);
  expect(bus.invoke("sum", 1, 2)).toBe(7);
});
