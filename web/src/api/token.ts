const KEY = "pointwright.token";

/** What the server wants to see, for as long as the tab is open; null where nothing was given. */
export function bearer(): string | null {
  try {
    return sessionStorage.getItem(KEY);
  } catch {
    return null;
  }
}

export function keepBearer(token: string): void {
  sessionStorage.setItem(KEY, token);
}

/**
 * The address as the viewer uses it, and the capability that a share link carried in its fragment
 * (`#s=<session>&k=<capability>`), which browsers never send and which is not left in the address.
 */
export function takeCapability(href: string): { href: string; capability: string | null } {
  const url = new URL(href);
  const view = new URLSearchParams(url.hash.slice(1));
  const capability = view.get("k");
  const session = view.get("s");
  if (capability === null && session === null) return { href, capability };
  view.delete("k");
  view.delete("s");
  if (session !== null) url.searchParams.set("session", session);
  // Cameras are written with commas; what is encoded is read as well.
  url.hash = view.toString();
  return { href: url.href, capability };
}

/** Where a share link leads. */
export function shareUrl(base: string, session: string, capability: string): string {
  return `${base}#s=${session}&k=${capability}`;
}
