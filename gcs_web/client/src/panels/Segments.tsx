/** What binds each stretch between two waypoints. */

import { goTo } from "../cursor";
import { number, sentenceCase } from "../format";
import { figures, segmentAtCursor } from "../store";

export function Segments() {
  const segments = figures.value?.segments ?? [];
  if (segments.length === 0) return <p class="empty">No segments yet. A plan has one between any two waypoints.</p>;
  return (
    <div class="table-scroll">
      <table class="table">
        <thead>
          <tr>
            <th scope="col">#</th>
            <th scope="col">
              from <span class="unit">s</span>
            </th>
            <th scope="col">
              takes <span class="unit">s</span>
            </th>
            <th scope="col" class="words">
              limit that binds
            </th>
            <th scope="col">
              used <span class="unit">%</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {segments.map((segment, index) => (
            <tr key={index} aria-selected={index === segmentAtCursor.value} onClick={() => goTo(segment.start_s)}>
              <th scope="row">{index + 1}</th>
              <td>
                <button
                  type="button"
                  class="link"
                  aria-label={`${number(segment.start_s, 2)} s, show segment ${index + 1}`}
                >
                  {number(segment.start_s, 2)}
                </button>
              </td>
              <td>{number(segment.end_s - segment.start_s, 2)}</td>
              <td class="words">{sentenceCase(segment.binding)}</td>
              <td class={segment.share > 0.95 ? "" : "dim"}>{number(100 * segment.share, 0)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
