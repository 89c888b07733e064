/** One box a segment, with the limit that binds it; above the plots and on their axis of time. */

import { useComputed } from "@preact/signals";
import { goTo } from "./cursor";
import { zoom } from "../../plots/plots";
import { figures, segmentAtCursor, series } from "../../core/store";
import type { Segment } from "../../core/protocol";

/** What a limit is called where there is room for one letter only. */
const LETTERS: Readonly<Record<string, string>> = {
  speed: "v",
  acceleration: "a",
  tilt: "t",
  clearance: "c",
  "roll and pitch rate": "p",
  "yaw rate": "y",
  "rotor speed": "f",
  "slowest rotor": "s",
};
const letter = (limit: string): string => LETTERS[limit] ?? limit.charAt(0);

const SHARE_AT_LIMIT = 0.98;
const LETTER_PX = 7;
const GAP_PX = 2;

interface StripProps {
  left: number;
  right: number;
  width: number;
}

export function BindingStrip({ left, right, width }: StripProps) {
  const segments = figures.value?.segments ?? [];
  const [from_s, to_s] = zoom.value ?? [0, series.value?.time_s.at(-1) ?? 0];
  const perSecond_px = (width - left - right) / Math.max(to_s - from_s, 1e-9);
  return (
    <div class="strip">
      <span class="strip-name">Limit that binds</span>
      {segments.map((segment, index) => {
        const start_s = Math.max(segment.start_s, from_s);
        const room_px = (Math.min(segment.end_s, to_s) - start_s) * perSecond_px - GAP_PX;
        const x_px = left + (start_s - from_s) * perSecond_px + GAP_PX / 2;
        return room_px < 1 ? null : <Box key={index} segment={segment} index={index} x_px={x_px} room_px={room_px} />;
      })}
    </div>
  );
}

interface BoxProps {
  segment: Segment;
  index: number;
  x_px: number;
  room_px: number;
}

function Box({ segment, index, x_px, room_px }: BoxProps) {
  const isAt = useComputed(() => segmentAtCursor.value === index).value;
  const fits = segment.binding.length * LETTER_PX < room_px;
  const words = fits ? segment.binding : room_px > LETTER_PX + 2 ? letter(segment.binding) : "";
  return (
    <button
      type="button"
      tabIndex={-1}
      class={`strip-box ${isAt ? "at" : ""} ${segment.share >= SHARE_AT_LIMIT ? "full" : ""}`}
      style={{ left: `${x_px}px`, width: `${room_px}px` }}
      title={`Segment ${index + 1}: ${segment.binding}, ${Math.round(100 * segment.share)} %`}
      onClick={() => goTo(segment.worst_s)}
    >
      {words}
    </button>
  );
}

/** What the letters in the strip mean. */
export function BindingWords() {
  const binding = [...new Set((figures.value?.segments ?? []).map((segment) => segment.binding))];
  if (binding.length === 0) return null;
  const words = binding.map((limit) => `${letter(limit)}: ${limit}`).join(" · ");
  const all = `${words} · brighter: above 98 % of limit`;
  return (
    <span class="quiet binding-words" title={all}>
      {all}
    </span>
  );
}
