type Child = Node | string | null | undefined | false;

type Listeners = {
  [Name in keyof HTMLElementEventMap as `on${Name}`]?: (event: HTMLElementEventMap[Name]) => void;
};

export type Props<Tag extends keyof HTMLElementTagNameMap> = Listeners & {
  class?: string;
  data?: Record<string, string>;
  aria?: Record<string, string>;
  role?: string;
} & Partial<Omit<HTMLElementTagNameMap[Tag], "style" | "children" | "className" | `on${string}`>>;

/** An element with its properties, listeners and children. Text is always text: nothing here parses HTML. */
export function h<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  props: Props<Tag> = {},
  ...children: Child[]
): HTMLElementTagNameMap[Tag] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined) continue;
    if (name === "class") element.className = value as string;
    else if (name === "data") Object.assign(element.dataset, value);
    else if (name === "role") element.setAttribute("role", value as string);
    else if (name === "aria") {
      for (const [key, text] of Object.entries(value as Record<string, string>))
        element.setAttribute(`aria-${key}`, text);
    } else if (name.startsWith("on")) element.addEventListener(name.slice(2), value as EventListener);
    else (element as unknown as Record<string, unknown>)[name] = value;
  }
  append(element, children);
  return element;
}

export function append(parent: Node, children: readonly Child[]): void {
  for (const child of children) {
    if (child !== null && child !== undefined && child !== false)
      parent.appendChild(typeof child === "string" ? document.createTextNode(child) : child);
  }
}

export function replaceChildren(parent: Element, ...children: Child[]): void {
  parent.textContent = "";
  append(parent, children);
}

let ids = 0;
/** An id that no other element has, to tie labels to fields. */
export function freshId(): string {
  ids += 1;
  return `f${ids}`;
}

export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}
