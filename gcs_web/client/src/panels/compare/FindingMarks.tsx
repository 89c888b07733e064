/** Where the checks found something in the open flights: a strip above the plots, in their time. */

import { LETTERS, chosenMark, fixFlight, goToMark, marks, open, shown } from "./flights";
import type { Mark } from "./flights";
import { computed } from "@preact/signals";
import { number } from "../../core/format";

/** Marks that are drawn; of more the first. */
const MOST = 200;
const NARROWEST_PX = 6;
/** Heights of the strip, and of the line below it. */
const MARKS_PX = 24;
const WORDS_PX = 22;

/** The mark whose words are shown, if it is still among those that are drawn. */
const shownMark = computed(() => {
  const chosen = chosenMark.value;
  return marks.value.find(({ flight, finding }) => flight === chosen?.flight && finding.sentence === chosen.finding.sentence);
});

/** What all of it takes of the drawer's height. */
export const marksPx = computed(() =>
  marks.value.length === 0 ? 0 : MARKS_PX + (shownMark.value === undefined ? 0 : WORDS_PX),
);

interface Props {
  width: number;
  margins: { left: number; right: number };
}

export function FindingMarks({ width, margins }: Props) {
  const [from_s, to_s] = shown.value;
  const seen = marks.value.filter((mark) => mark.to_s >= from_s && mark.from_s <= to_s).slice(0, MOST);
  const chosen = shownMark.value;
  if (marks.value.length === 0) return null;
  const room = width - margins.left - margins.right;
  const place = (time_s: number): number => Math.min(Math.max((room * (time_s - from_s)) / (to_s - from_s), 0), room);
  return (
    <>
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
              onClick={() => {
                chosenMark.value = mark;
                goToMark(mark);
              }}
            />
          );
        })}
      </div>
    </div>
    {chosen !== undefined && <Chosen mark={chosen} />}
    </>
  );
}

/** What the clicked mark is, and its fix by one click. */
function Chosen({ mark }: { mark: Mark }) {
  const { flight, finding } = mark;
  return (
    <p class="mark-words" style={{ height: `${WORDS_PX}px` }} title={finding.fix}>
      <span class="mark-sentence">
        {words(mark)}. <span class="quiet">{finding.fix}</span>
      </span>
      {finding.fixable && (
        <button type="button" class="link small" onClick={() => void fixFlight(flight, finding.sentence)}>
          Apply this to a new log
        </button>
      )}
      <button type="button" class="link small" onClick={() => (chosenMark.value = null)}>
        Close
      </button>
    </p>
  );
}

function words({ flight, finding, from_s }: Mark): string {
  const letter = open.value.length > 1 ? `${LETTERS[open.value.indexOf(flight)] ?? ""} ` : "";
  return `${letter}${finding.sentence}, at ${number(from_s, 2)} s`;
}
