/** Colour scales of measured quantities; the same on path, table and legend. */

import type { Series, Show } from "../core/protocol";

export type PathColour = NonNullable<Show["colour"]>;

/** Viridis turned round, without its dark end: the required clearance is yellow, plenty of it blue-green. */
export const CLEARANCE = [
  "#fde724",
  "#d2e11b",
  "#a2da37",
  "#77d052",
  "#4fc369",
  "#32b57a",
  "#20a585",
  "#1f948b",
  "#24848d",
] as const;
/** For everything else, from the smallest to the largest value: cividis without its dark end. */
export const CIVIDIS = [
  "#717273",
  "#807e78",
  "#918c77",
  "#a39a74",
  "#b4a76f",
  "#c7b666",
  "#d9c55a",
  "#edd648",
  "#fde737",
] as const;

/** Where a simulated flight touches something, or is lost. */
export const TOUCHING = "#ff7a66";

/** From the most negative to the most positive value, zero in the middle. */
export const SIGNED = ["#3a86ff", "#949ba3", "#ff961e"] as const;

/** The scale of clearance reaches this far above what is required. */
export const CLEARANCE_SPAN_M = 0.7;

/** Upper end of the scale of the thinnest object that the images show. */
export const COULD_HIDE_SPAN_MM = 100;

/** Upper end of the scale of a surface's standard deviation. */
export const SURFACE_STD_SPAN_MM = 50;

const PATH_VALUES: Readonly<Record<Exclude<PathColour, "clearance">, (shown: Series) => readonly number[]>> = {
  could_hide: (shown) => shown.could_hide_mm,
  speed: (shown) => shown.speed_m_s,
  thrust: (shown) => shown.thrust_n,
  rotor_margin: (shown) => shown.rotor_margin_percent,
  tilt: (shown) => shown.tilt_deg,
};

/** The smallest and the largest value of a path, which its scale spans. */
export function pathEnds(colour: Exclude<PathColour, "clearance">, shown: Series): [number, number] {
  if (colour === "could_hide") return [0, COULD_HIDE_SPAN_MM];
  const values = PATH_VALUES[colour](shown);
  return [Math.min(...values), Math.max(...values)];
}

/** Of each sample of a path; where nothing is known of what could hide, as where no image looked. */
export function pathColours(colour: PathColour, shown: Series, required_m: number): string[] {
  if (colour === "clearance") return shown.clearance_m.map((value) => clearanceColour(value, required_m));
  const [low, high] = pathEnds(colour, shown);
  const share = (value: number): number => Math.min(1, Math.max(0, (value - low) / Math.max(high - low, 1e-9)));
  const values = PATH_VALUES[colour](shown);
  return shown.time_s.map((_, i) => CIVIDIS[Math.round(share(values[i] ?? high) * (CIVIDIS.length - 1))] ?? CIVIDIS[0]);
}

export function clearanceColour(clearance_m: number, required_m: number): string {
  const share = Math.min(1, Math.max(0, (clearance_m - required_m) / CLEARANCE_SPAN_M));
  return CLEARANCE[Math.round(share * (CLEARANCE.length - 1))] ?? CLEARANCE[0];
}

/** All of cividis at a share of 0 to 1: red, green, blue. */
export function darkToYellow(share: number): [number, number, number] {
  const at = Math.min(1, Math.max(0, share)) * (DARK_TO_YELLOW.length - 1);
  const [low, high] = [DARK_TO_YELLOW[Math.floor(at)] ?? [0, 0, 0], DARK_TO_YELLOW[Math.ceil(at)] ?? [0, 0, 0]];
  const part = at - Math.floor(at);
  const mix = (i: 0 | 1 | 2): number => Math.round(low[i] + part * (high[i] - low[i]));
  return [mix(0), mix(1), mix(2)];
}

const DARK_TO_YELLOW: readonly (readonly [number, number, number])[] = [
  [0, 34, 78],
  [53, 69, 108],
  [102, 105, 112],
  [148, 142, 119],
  [200, 184, 102],
  [254, 232, 56],
];
