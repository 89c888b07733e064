/** Which part of the world the map from above shows. */

import type { Size } from "../../plots/width";
import { doc, flown, section, series, vehicle } from "../../core/store";

export interface Point {
  x_m: number;
  y_m: number;
}

/** What is in the middle, and pixels per metre. */
export interface Place extends Point {
  scale: number;
}

interface Box {
  low: readonly [number, number];
  high: readonly [number, number];
}

const MARGIN_PX = 56;
const [LEAST_SCALE, LARGEST_SCALE] = [1, 2000];
/** Round a vehicle that has nothing round it. */
const ROOM_M = 4;

/** All that there is: the map, or what is flown where there is none. */
export function extent(): Box {
  const { image, low_m, high_m } = section.value;
  if (image !== "") return { low: low_m, high: high_m };
  const { x_m: xs = [], y_m: ys = [] } = series.value ?? {};
  const points: Point[] = [...(doc.value?.waypoints ?? []), ...flown.value, ...xs.map((x_m, i) => ({ x_m, y_m: ys[i] ?? 0 }))];
  const last = vehicle.value;
  if (last?.x_m !== null && last?.y_m !== null && last !== null) {
    points.push({ x_m: last.x_m - ROOM_M, y_m: last.y_m - ROOM_M }, { x_m: last.x_m + ROOM_M, y_m: last.y_m + ROOM_M });
  }
  if (points.length === 0) return { low: [-ROOM_M, -ROOM_M], high: [ROOM_M, ROOM_M] };
  const [x_m, y_m] = [points.map((each) => each.x_m), points.map((each) => each.y_m)];
  return { low: [Math.min(...x_m) - 1, Math.min(...y_m) - 1], high: [Math.max(...x_m) + 1, Math.max(...y_m) + 1] };
}

export function fitted({ low, high }: Box, { width, height }: Size): Place {
  const scale = Math.min((width - MARGIN_PX) / (high[0] - low[0]), (height - MARGIN_PX) / (high[1] - low[1]));
  return { x_m: (low[0] + high[0]) / 2, y_m: (low[1] + high[1]) / 2, scale: bounded(scale) };
}

/** The place, moved on where a vehicle in flight would leave it. */
export function followed(place: Place, { width, height }: Size): Place {
  const last = vehicle.value;
  if (last === null || !last.armed || last.x_m === null || last.y_m === null) return place;
  const [right_m, up_m] = [last.x_m - place.x_m, last.y_m - place.y_m];
  const [most_x_m, most_y_m] = [width, height].map((size) => Math.max(0, size / 2 - MARGIN_PX) / place.scale);
  const beyond = (off_m: number, most_m = 0): number => off_m - Math.min(Math.max(off_m, -most_m), most_m);
  return { ...place, x_m: place.x_m + beyond(right_m, most_x_m), y_m: place.y_m + beyond(up_m, most_y_m) };
}

export function panned(place: Place, right_px: number, down_px: number): Place {
  return { ...place, x_m: place.x_m - right_px / place.scale, y_m: place.y_m + down_px / place.scale };
}

/** Larger by a factor, with the point under the pointer where it was. */
export function zoomed(place: Place, { width, height }: Size, [x, y]: readonly [number, number], by: number): Place {
  const scale = bounded(place.scale * by);
  const [right, up] = [x - width / 2, height / 2 - y];
  const by_m = 1 / place.scale - 1 / scale;
  return { x_m: place.x_m + right * by_m, y_m: place.y_m + up * by_m, scale };
}

const bounded = (scale: number): number => Math.min(LARGEST_SCALE, Math.max(LEAST_SCALE, scale));

const BAR_PX = 120;

/** The longest of 1, 2 and 5 times a power of ten that is not too wide on the screen, in metres. */
export function scaleBar(scale: number): number {
  const most_m = BAR_PX / scale;
  const power = 10 ** Math.floor(Math.log10(most_m));
  return Number(((most_m >= 5 * power ? 5 : most_m >= 2 * power ? 2 : 1) * power).toPrecision(1));
}
