import { h, setText } from "./dom";
import { icon } from "./icons";

/** Acts at the second press: the first only asks, until the hand or the focus goes elsewhere. */
function askTwice(
  button: HTMLButtonElement,
  label: string,
  action: () => void,
  show?: (text: string) => void,
) {
  const arm = (armed: boolean): void => {
    button.classList.toggle("armed", armed);
    button.setAttribute("aria-label", armed ? `${label}: press again to confirm` : label);
    show?.(armed ? "Press again" : "");
  };
  button.addEventListener("click", () => {
    const armed = button.classList.contains("armed");
    arm(!armed);
    if (armed) action();
  });
  button.addEventListener("blur", () => arm(false));
  button.addEventListener("pointerleave", () => arm(false));
}

export function confirmButton(label: string, action: () => void): HTMLButtonElement {
  const button = h(
    "button",
    { type: "button", class: "icon-button small delete", title: label, aria: { label } },
    icon("trash"),
  );
  askTwice(button, label, action);
  return button;
}

/** The same with words on it; `label` says more than they do. */
export function confirmTextButton(text: string, label: string, action: () => void): HTMLButtonElement {
  const words = h("span", {}, text);
  const button = h("button", { type: "button", class: "button quiet", aria: { label } }, words);
  askTwice(button, label, action, (asks) => setText(words, asks || text));
  return button;
}
