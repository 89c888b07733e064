/** Less is drawn in the 3D view where this machine draws slowly: measured before it is loaded, and while it is shown. */

import { computed, effect, signal } from "@preact/signals";
import { number } from "../../core/format";
import { drawsSlowly } from "../../core/machine";
import { send } from "../../core/socket";
import { announce, connected } from "../../core/store";
import { VIEW, fromAbove } from "./view";

/** Triangles of the mesh, level by level; below the last one pixels are left out, then the map from above is offered. */
const LEVELS = [20_000, 6_000, 1_500] as const;
/** Where a machine begins that draws a picture of many sums slowly. */
const FIRST_SLOW = 1;
const LEAST_FRAMES_S = 10;
/** How long frames are counted, how often it must be slow, and what of the beginning (loading) does not count. */
const [WINDOW_MS, SLOW_WINDOWS, FIRST_WINDOWS] = [2000, 2, 2];
/** A longer window was not drawn at all, as in a tab behind others. */
const ASLEEP_MS = 15_000;

/** Index of `LEVELS`; -1: all that there is. */
const level = signal(-1);
/** Whether the 3D view lacks triangles of the mesh. */
export const isSimplified = computed(() => level.value >= 0);

/** Whether one pixel is drawn for four: without a graphics card pixels cost more than the last level's triangles. */
export const isCoarse = signal(false);

/** Measure this machine and tell the station; done when it knows. */
export async function measure(): Promise<void> {
  if (level.value < 0 && drawsSlowly()) level.value = FIRST_SLOW;
  await tell();
}

async function tell(): Promise<void> {
  const triangles = LEVELS[level.value];
  if (triangles !== undefined) await send({ type: "draw_plainly", view: VIEW, triangles });
}

/** A station that was started anew does not know it. */
effect(() => {
  if (connected.value && level.value >= 0) void tell();
});

let watched = false;

/** Count the frames from now on, and draw less where there are too few. */
export function watchPace(): void {
  if (watched) return;
  watched = true;
  let [frames, since_ms, windows, slow] = [0, performance.now(), 0, 0];
  const frame = (): void => {
    frames += 1;
    const [now_ms, isShown] = [performance.now(), !fromAbove.peek() && !document.hidden];
    const took_ms = now_ms - since_ms;
    if (took_ms >= WINDOW_MS) {
      const frames_s = (1000 * frames) / took_ms;
      windows = isShown ? windows + 1 : 0;
      const counts = windows > FIRST_WINDOWS && took_ms < ASLEEP_MS;
      slow = counts && frames_s < LEAST_FRAMES_S ? slow + 1 : 0;
      if (slow === SLOW_WINDOWS) {
        drawLess(frames_s);
        windows = slow = 0;
      }
      [frames, since_ms] = [0, now_ms];
    }
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

let saidSo = false;

/** Nobody's view is taken away. */
function drawLess(frames_s: number): void {
  if (level.value < LEVELS.length - 1) level.value += 1;
  else if (!isCoarse.value) isCoarse.value = true;
  else if (!saidSo) {
    saidSo = true;
    announce(`3D draws ${number(frames_s, 1)} frames a second here. T shows Top, which is lighter.`);
  }
}
