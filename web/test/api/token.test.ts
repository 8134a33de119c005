import { expect, test } from "vitest";
import { ApiClient } from "../../src/api/client";
import { shareUrl, takeCapability } from "../../src/api/token";

const SESSION = "Jq3cT9rVwXyZ0a1b2c3d4e";
const CAPABILITY = `pws_${"a".repeat(43)}`;

test("a share link gives its session to the query and its capability to nobody", () => {
  const link = shareUrl("https://host.example/sub/", SESSION, CAPABILITY);
  const taken = takeCapability(link);
  expect(taken.capability).toBe(CAPABILITY);
  expect(taken.href).toBe(`https://host.example/sub/?session=${SESSION}`);
});

test("the rest of the fragment stays, and addresses without a capability stay as they are", () => {
  const plain = `https://host.example/?session=${SESSION}#cam=1,2,3&mode=shaded`;
  expect(takeCapability(plain)).toEqual({ href: plain, capability: null });
  const taken = takeCapability(`${plain}&k=${CAPABILITY}`);
  expect(taken.href).not.toContain(CAPABILITY);
  expect(new URLSearchParams(new URL(taken.href).hash.slice(1)).get("cam")).toBe("1,2,3");
});

test("the client sends its token with every request, beside the other headers", async () => {
  const seen: HeadersInit[] = [];
  const answer = async (_: string, init?: RequestInit): Promise<Response> => {
    seen.push(init?.headers ?? {});
    return new Response("{}");
  };
  const client = new ApiClient("https://host.example/", answer, () => CAPABILITY);
  await client.info();
  await client.putHead(SESSION, 1, 2);
  expect(seen[0]).toEqual({ Authorization: `Bearer ${CAPABILITY}` });
  expect(seen[1]).toMatchObject({ Authorization: `Bearer ${CAPABILITY}`, "If-Match": '"r2"' });
  seen.length = 0;
  await new ApiClient("https://host.example/", answer).info();
  expect(seen[0]).toEqual({});
});
