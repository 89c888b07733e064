/** A fact in a frame; the text always says what the colour says. */

import type { ComponentChildren } from "preact";

export type Tone = "neutral" | "accent" | "caution" | "danger";

export function Badge({ tone = "neutral", children }: { tone?: Tone; children: ComponentChildren }) {
  return <span class={`badge ${tone}`}>{children}</span>;
}
