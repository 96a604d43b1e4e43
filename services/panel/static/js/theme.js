// Dark or light: the system's choice until somebody presses the switch.

import { byId } from "./dom.js";

const system = matchMedia("(prefers-color-scheme: dark)");
const listeners = [];

export const isDark = () => (document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";

export function onTheme(listener) {
  listeners.push(listener);
}

// A colour of the theme by the name of its CSS variable.
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export function startTheme() {
  const changed = () => listeners.forEach((each) => each());
  system.addEventListener("change", changed);
  byId("theme").addEventListener("click", () => {
    const chosen = isDark() ? "light" : "dark";
    document.documentElement.dataset.theme = chosen;
    try { localStorage.setItem("elea.theme", chosen); } catch { /* forgotten */ }
    changed();
  });
}
