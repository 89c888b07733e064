/** Where the checks found something in the open flights: a strip above the plots, in their time. */

import { LETTERS, goToMark, marks, open, shown } from "./flights";
import type { Mark } from "./flights";
import { number } from "../../core/format";

/** Marks that are drawn; of more the first. */
const MOST = 200;
const NARROWEST_PX = 6;
/** Height of the strip. */
export const MARKS_PX = 24;

interface Props {
  width: number;
  margins: { left: number; right: number };
}

export function FindingMarks({ width, margins }: Props) {
  const [from_s, to_s] = shown.value;
  const seen = marks.value.filter((mark) => mark.to_s >= from_s && mark.from_s <= to_s).slice(0, MOST);
  if (marks.value.length === 0) return null;
  const room = width - margins.left - margins.right;
  const place = (time_s: number): number => Math.min(Math.max((room * (time_s - from_s)) / (to_s - from_s), 0), room);
  return (
    <div class="marks" style={{ height: `${MARKS_PX}px` }} role="group" aria-label="Findings of the checks">
      <span class="quiet">Findings</span>
      <div class="marks-line" style={{ left: `${margins.left}px`, width: `${room}px` }}>
        {seen.map((mark, i) => {
          const left = place(mark.from_s);
          return (
            <button
              key={i}
              type="button"
              class={`mark-stretch ${mark.finding.level}`}
              style={{ left: `${left}px`, width: `${Math.max(place(mark.to_s) - left, NARROWEST_PX)}px` }}
              aria-label={words(mark)}
              title={words(mark)}
              onClick={() => goToMark(mark)}
            />
          );
        })}
      </div>
    </div>
  );
}

function words({ flight, finding, from_s }: Mark): string {
  const letter = open.value.length > 1 ? `${LETTERS[open.value.indexOf(flight)] ?? ""} ` : "";
  return `${letter}${finding.sentence}, at ${number(from_s, 2)} s`;
}
