/** Colour scales of measured quantities; the same on path, table and legend. */

export const VIRIDIS = [
  "#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725",
] as const;
export const CIVIDIS = [
  "#00224e", "#1a386f", "#434e6c", "#61656f", "#7d7c78", "#9b9476", "#bcae6c", "#dec958", "#fee838",
] as const;

/** The scale of clearance reaches this far above what is required. */
export const CLEARANCE_SPAN_M = 0.7;

/** Viridis turned round: the required clearance is yellow, plenty of it violet. */
export function clearanceColour(clearance_m: number, required_m: number): string {
  const share = Math.min(1, Math.max(0, (clearance_m - required_m) / CLEARANCE_SPAN_M));
  return VIRIDIS[Math.round((1 - share) * (VIRIDIS.length - 1))] ?? VIRIDIS[0];
}
