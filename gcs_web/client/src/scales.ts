/** Colour scales of measured quantities; the same on path, table and legend. */

/** Viridis turned round: the required clearance is yellow, plenty of it violet. */
export const CLEARANCE = [
  "#fde725",
  "#addc30",
  "#5ec962",
  "#28ae80",
  "#21918c",
  "#2c728e",
  "#3b528b",
  "#472d7b",
  "#440154",
] as const;
/** For everything else, from the smallest to the largest value. */
export const CIVIDIS = [
  "#00224e",
  "#1a386f",
  "#434e6c",
  "#61656f",
  "#7d7c78",
  "#9b9476",
  "#bcae6c",
  "#dec958",
  "#fee838",
] as const;

/** From the most negative to the most positive value, zero in the middle. */
export const SIGNED = ["#3a86ff", "#949ba3", "#ff961e"] as const;

/** The scale of clearance reaches this far above what is required. */
export const CLEARANCE_SPAN_M = 0.7;

/** Upper end of the scale of the thinnest object that the images show. */
export const COULD_HIDE_SPAN_MM = 100;

export function clearanceColour(clearance_m: number, required_m: number): string {
  const share = Math.min(1, Math.max(0, (clearance_m - required_m) / CLEARANCE_SPAN_M));
  return CLEARANCE[Math.round(share * (CLEARANCE.length - 1))] ?? CLEARANCE[0];
}
