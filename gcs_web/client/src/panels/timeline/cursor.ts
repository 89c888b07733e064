/** The moment that plots, table and 3D view show together, and playing through the plan. */

import { effect, signal } from "@preact/signals";
import { latest } from "../../core/socket";
import { cursor_s, isFlown, selected, series, step, vehicle, view } from "../../core/store";

const FLY_STEP = 3;
const sendLook = latest((time_s: number | null) => ({ type: "look", time_s }));
const sendSelection = latest((waypoints: number[]) => ({ type: "select", waypoints }));
const sendView = latest((shown: typeof view.value) => ({ type: "show", ...shown }));

/** Show a moment of the plan everywhere. */
function lookAt(time_s: number): void {
  const end_s = series.value?.time_s.at(-1);
  if (end_s === undefined) return;
  cursor_s.value = Math.min(Math.max(time_s, 0), end_s);
  sendLook(cursor_s.value);
}

/** As `lookAt`, and stop playing: someone asked for this moment. */
export function goTo(time_s: number): void {
  playing.value = false;
  lookAt(time_s);
}

export function select(ids: Iterable<number>): void {
  selected.value = new Set(ids);
  sendSelection([...selected.value]);
}

export function show(change: Partial<typeof view.value>): void {
  view.value = { ...view.value, ...change };
  sendView(view.value);
}

// --- playing ---

export const playing = signal(false);
const RATES = [0.25, 0.5, 1, 2] as const;
export const rate = signal<(typeof RATES)[number]>(1);

export function togglePlaying(): void {
  const end_s = series.value?.time_s.at(-1);
  if (end_s === undefined) return;
  if (!playing.value && (cursor_s.value ?? 0) >= end_s - 1e-3) lookAt(0);
  playing.value = !playing.value;
}

export function nextRate(): void {
  rate.value = RATES[(RATES.indexOf(rate.value) + 1) % RATES.length] ?? 1;
}

effect(() => {
  if (!playing.value) return undefined;
  let last_ms: number | null = null;
  let request = requestAnimationFrame(function frame(time_ms: number) {
    if (last_ms !== null) lookAt((cursor_s.peek() ?? 0) + (rate.peek() * (time_ms - last_ms)) / 1000);
    last_ms = time_ms;
    const end_s = series.peek()?.time_s.at(-1) ?? 0;
    if ((cursor_s.peek() ?? 0) >= end_s) playing.value = false;
    else request = requestAnimationFrame(frame);
  });
  return () => cancelAnimationFrame(request);
});

/** On the step Fly the cursor runs with the vehicle. */
effect(() => {
  const along_s = vehicle.value?.along_s ?? null;
  if (step.value !== FLY_STEP || along_s === null || !isFlown.value) return;
  playing.value = false;
  cursor_s.value = Math.min(along_s, series.peek()?.time_s.at(-1) ?? 0);
});
