/** The upper edge of the drawer: dragged or moved with the arrow keys, kept for each step. */

import { remembered } from "../core/remembered";
import { low } from "../core/theme";

const LOWEST_PX = 162;
const HIGHEST_PX = 448;
const HIGHEST_IN_LOW_WINDOW_PX = 260;
const KEY_PX = 16;

const isHeights = (value: unknown): value is Record<number, number> =>
  typeof value === "object" && value !== null && Object.values(value).every((height) => typeof height === "number");

const heights = remembered<Record<number, number>>("drawer", { 2: 260, 3: 228, 4: 448 }, isHeights);

/** In a low window the 3D view must not vanish behind it. */
const highest = (): number => (low.value ? HIGHEST_IN_LOW_WINDOW_PX : HIGHEST_PX);
const bounded = (height: number): number => Math.round(Math.min(highest(), Math.max(LOWEST_PX, height)));

export function drawerHeight(step: number): number {
  return bounded(heights.value[step] ?? LOWEST_PX);
}

export function Resizer({ step }: { step: number }) {
  const height = drawerHeight(step);
  const set = (wanted: number): void => {
    heights.value = { ...heights.value, [step]: bounded(wanted) };
  };
  const drag = (event: PointerEvent): void => {
    const edge = event.currentTarget as HTMLElement;
    const start = event.clientY + height;
    edge.setPointerCapture(event.pointerId);
    const move = (moved: PointerEvent): void => set(start - moved.clientY);
    edge.addEventListener("pointermove", move);
    edge.addEventListener("lostpointercapture", () => edge.removeEventListener("pointermove", move), { once: true });
  };
  return (
    <div
      class="resizer"
      role="separator"
      aria-orientation="horizontal"
      aria-label="Height of the timeline"
      aria-valuemin={LOWEST_PX}
      aria-valuemax={highest()}
      aria-valuenow={height}
      tabIndex={0}
      onPointerDown={drag}
      onKeyDown={(event) => {
        const by = event.key === "ArrowUp" ? KEY_PX : event.key === "ArrowDown" ? -KEY_PX : 0;
        if (by === 0) return;
        event.preventDefault();
        set(height + by);
      }}
    />
  );
}
