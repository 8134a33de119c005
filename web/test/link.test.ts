import { expect, test } from "vitest";
import { displayFromLink, readLink, sessionUrl, viewHash } from "../src/link";
import { DEFAULT_DISPLAY } from "../src/scene/display";

const ID = "abcdefghijklmnopqrst-_";

test("a link reopens the session, the camera and the display", () => {
  const camera = { position: [1, 2, 3], target: [0, 0, 0], up: [0, 1, 0] } as const;
  const hash = viewHash(camera, { ...DEFAULT_DISPLAY, mode: "t" });
  expect(readLink(`?session=${ID}`, hash)).toEqual({ session: ID, ui: true, camera, mode: "t" });
  expect(readLink("?ui=0", "").ui).toBe(false);
  expect(displayFromLink("t", DEFAULT_DISPLAY).mode).toBe("t");
  expect(displayFromLink("bogus", DEFAULT_DISPLAY)).toEqual(DEFAULT_DISPLAY);
});

test("what is no session's id opens none", () => {
  for (const id of ["", "short", `${ID}x`, "../../../v1/clouds/aaaa", "abcdefghijklmnopqrst /"]) {
    expect(readLink(`?session=${encodeURIComponent(id)}`, "").session, id).toBeNull();
  }
  expect(sessionUrl(ID)).toBe(`./?session=${ID}`);
});
