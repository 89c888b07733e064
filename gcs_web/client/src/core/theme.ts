/** Dark or light, as the system says or as chosen here, and which layout fits the window. */

import { computed, effect, signal } from "@preact/signals";
import { remembered } from "./remembered";

const THEMES = ["system", "dark", "light"] as const;
type Theme = (typeof THEMES)[number];

const isTheme = (value: unknown): value is Theme => THEMES.some((theme) => theme === value);

export const theme = remembered<Theme>("theme", "system", isTheme);
export const phone = media("(max-width: 719px)");
export const narrow = media("(max-width: 1279px)");
export const low = media("(max-height: 767px)");
export const reducedMotion = media("(prefers-reduced-motion: reduce)");
const systemIsLight = media("(prefers-color-scheme: light)");

export const isLight = computed(() => (theme.value === "system" ? systemIsLight.value : theme.value === "light"));

effect(() => {
  document.documentElement.dataset.theme = isLight.value ? "light" : "dark";
});

export function nextTheme(): void {
  theme.value = THEMES[(THEMES.indexOf(theme.value) + 1) % THEMES.length] ?? "system";
}

/** A colour token of style.css, for what is drawn on a canvas. */
export function token(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function media(query: string) {
  const list = matchMedia(query);
  const matches = signal(list.matches);
  list.addEventListener("change", () => (matches.value = list.matches));
  return matches;
}
