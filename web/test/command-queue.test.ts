import { expect, test } from "vitest";
import { CommandQueue } from "../src/command-queue";

function gate(): { promise: Promise<void>; open: () => void } {
  let open = (): void => undefined;
  const promise = new Promise<void>((resolve) => {
    open = resolve;
  });
  return { promise, open };
}

test("commands run one after the other, in the order of their coming", async () => {
  const queue = new CommandQueue();
  const first = gate();
  const log: string[] = [];
  const a = queue.enqueue(async () => {
    log.push("a begins");
    await first.promise;
    log.push("a ends");
  });
  const b = queue.enqueue(async () => {
    log.push("b");
  });
  await Promise.resolve();
  expect(queue.length).toBe(2);
  first.open();
  await Promise.all([a, b]);
  expect(log).toEqual(["a begins", "a ends", "b"]);
  expect(queue.length).toBe(0);
});

test("a command that fails tells its own caller and stops nobody behind it", async () => {
  const queue = new CommandQueue();
  const bad = queue.enqueue(() => Promise.reject(new Error("refused")));
  const good = queue.enqueue(() => Promise.resolve(5));
  await expect(bad).rejects.toThrow("refused");
  expect(await good).toBe(5);
});

test("a command that throws before it returns a promise fails like any other", async () => {
  const queue = new CommandQueue();
  const bad = queue.enqueue((): Promise<number> => {
    throw new Error("at once");
  });
  await expect(bad).rejects.toThrow("at once");
  expect(await queue.enqueue(() => Promise.resolve(1))).toBe(1);
});
