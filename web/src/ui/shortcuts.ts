import { belongsToField } from "../keys";

/** One row of the sheet, and what its key does. */
export interface Shortcut {
  group: string;
  /** As shown: "Ctrl Z". */
  keys: string;
  label: string;
  matches?: (event: KeyboardEvent) => boolean;
  run?: (event: KeyboardEvent) => void;
}

/** Matches a bare key, whatever the case. */
export function key(name: string): (event: KeyboardEvent) => boolean {
  return (event) =>
    !event.ctrlKey && !event.metaKey && !event.altKey && event.key.toLowerCase() === name.toLowerCase();
}

export function ctrl(name: string, shift = false): (event: KeyboardEvent) => boolean {
  return (event) =>
    (event.ctrlKey || event.metaKey) && event.shiftKey === shift && event.key.toLowerCase() === name;
}

/** Runs the shortcuts of the table; returns the function that ends it. */
export function listen(shortcuts: readonly Shortcut[]): () => void {
  const onKey = (event: KeyboardEvent): void => {
    const chord = event.ctrlKey || event.metaKey;
    if (belongsToField(event) && event.key !== "Escape" && !chord) return;
    // In a field, Ctrl+Z is the field's own.
    if (belongsToField(event) && chord) return;
    if (document.querySelector("dialog[open]")) return;
    const found = shortcuts.find((shortcut) => shortcut.matches?.(event));
    if (!found?.run) return;
    event.preventDefault();
    found.run(event);
  };
  window.addEventListener("keydown", onKey);
  return () => window.removeEventListener("keydown", onKey);
}
