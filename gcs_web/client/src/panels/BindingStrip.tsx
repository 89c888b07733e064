/** One box a segment, with the limit that binds it; above the plots and on their axis of time. */

import { goTo } from "../cursor";
import { cursor_s, figures, series } from "../store";
import { zoom } from "../plots";

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

export function BindingStrip({ left, right, width }: { left: number; right: number; width: number }) {
  const segments = figures.value?.segments ?? [];
  const end_s = series.value?.time_s.at(-1) ?? 0;
  const [from_s, to_s] = zoom.value ?? [0, end_s];
  const perSecond_px = (width - left - right) / Math.max(to_s - from_s, 1e-9);
  const at_s = cursor_s.value ?? 0;
  return (
    <div class="strip">
      <span class="strip-name">Limit that binds</span>
      {segments.map((segment, index) => {
        const start_s = Math.max(segment.start_s, from_s);
        const stop_s = Math.min(segment.end_s, to_s);
        const room_px = (stop_s - start_s) * perSecond_px - GAP_PX;
        if (room_px < 1) return null;
        const words = segment.binding.length * LETTER_PX < room_px ? segment.binding : letter(segment.binding);
        const isAt = segment.start_s <= at_s && at_s < segment.end_s;
        return (
          <button
            key={index}
            type="button"
            tabIndex={-1}
            class={`strip-box ${isAt ? "at" : ""} ${segment.share >= SHARE_AT_LIMIT ? "full" : ""}`}
            style={{ left: `${left + (start_s - from_s) * perSecond_px + GAP_PX / 2}px`, width: `${room_px}px` }}
            title={`Segment ${index + 1}: ${segment.binding}, ${Math.round(100 * segment.share)} %`}
            onClick={() => goTo(segment.start_s)}
          >
            {room_px > LETTER_PX + 2 ? words : ""}
          </button>
        );
      })}
    </div>
  );
}

/** What the letters in the strip mean. */
export function BindingWords() {
  const binding = [...new Set((figures.value?.segments ?? []).map((segment) => segment.binding))];
  if (binding.length === 0) return null;
  const words = binding.map((limit) => `${letter(limit)} ${limit}`).join(" · ");
  return <span class="quiet binding-words">{words} · brighter: above 98 % of limit</span>;
}
