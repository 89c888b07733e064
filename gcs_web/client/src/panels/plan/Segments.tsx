/** What binds each stretch between two waypoints, and the way to the moment where it binds most. */

import { computed } from "@preact/signals";
import { goTo, select } from "../timeline/cursor";
import { number, sentenceCase } from "../../core/format";
import { doc, figures, figuresAreOld, segmentAtCursor } from "../../core/store";
import type { Segment } from "../../core/protocol";

/** Above this share a limit decides the time that the segment takes. */
const SHARE_THAT_BINDS = 0.95;

const numbers = computed(() => new Map((doc.value?.waypoints ?? []).map(({ id }, index) => [id, index + 1])));

const place = (id: number | null): string => (id === null ? "ground" : String(numbers.value.get(id) ?? "–"));

export function Segments() {
  const segments = figures.value?.segments ?? [];
  if (segments.length === 0) return <p class="empty">No segments yet. A plan has one between any two waypoints.</p>;
  return (
    <>
      <div class="table-scroll">
        <table class={`table segments ${figuresAreOld.value ? "old" : ""}`} aria-label="Segments">
          <thead>
            <tr>
              <th scope="col">from–to</th>
              <th scope="col">
                takes <span class="unit">s</span>
              </th>
              <th scope="col" class="words">
                limit that binds
              </th>
              <th scope="col">
                used <span class="unit">%</span>
              </th>
              <th scope="col">
                most at <span class="unit">s</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {segments.map((segment, index) => (
              <tr
                key={index}
                aria-selected={index === segmentAtCursor.value}
                onClick={() => goToWorst(segment)}
              >
                <th scope="row">
                  {place(segment.start)}–{place(segment.end)}
                </th>
                <td>{number(segment.end_s - segment.start_s, 2)}</td>
                <td class="words">{sentenceCase(segment.binding)}</td>
                <td class={segment.share > SHARE_THAT_BINDS ? "" : "dim"}>{number(100 * segment.share, 0)}</td>
                <td>
                  <button
                    type="button"
                    class="link"
                    aria-label={`${segment.binding}: show ${number(segment.worst_s, 2)} s`}
                  >
                    {number(segment.worst_s, 2)}
                  </button>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <Tightest segments={segments} />
    </>
  );
}

function Tightest({ segments }: { segments: readonly Segment[] }) {
  const tightest = segments.reduce((a, b) => (b.share > a.share ? b : a));
  return (
    <div class="table-buttons">
      <button type="button" class="control" onClick={() => goToWorst(tightest)}>
        Go to the tightest
      </button>
      <span class="quiet">
        {tightest.binding}, {number(100 * tightest.share, 0)} % at {number(tightest.worst_s, 2)} s
      </span>
    </div>
  );
}

/** Cursor, plots and 3D view go to the moment; the waypoint before it is selected. */
function goToWorst({ start, worst_s }: Segment): void {
  if (start !== null) select([start]);
  goTo(worst_s);
}
