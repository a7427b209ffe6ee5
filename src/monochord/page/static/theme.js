// Light and dark: as the system says, or as a person chose.

const dark = matchMedia("(prefers-color-scheme: dark)");
const root = document.documentElement;
const NAMES = ["ink", "muted", "line", "estimate", "spread", "truth", "hand", "string", "swing", "mark", "surface", "range"];

// What is kept in this browser, where it keeps anything.
export function kept(name) { try { return localStorage.getItem(name); } catch { return null; } }
export function keep(name, value) { try { localStorage.setItem(name, value); } catch { /* no storage */ } }

export function colours() {
  const style = getComputedStyle(root);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

// Wires the button; `recolour` is called at once, and after each change.
export function themed(recolour) {
  if (kept("theme")) root.dataset.theme = kept("theme");
  recolour();
  dark.addEventListener("change", recolour);
  document.getElementById("theme").addEventListener("click", () => {
    const now = root.dataset.theme ?? (dark.matches ? "dark" : "light");
    root.dataset.theme = now === "dark" ? "light" : "dark";
    keep("theme", root.dataset.theme);
    recolour();
  });
}
