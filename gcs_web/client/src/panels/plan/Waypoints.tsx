/** The waypoints as a table: edited in place, alone or many together. */

import { signal, useComputed } from "@preact/signals";
import { canSplit, deleteSelected, insertAfterSelected, reverse, splitAtCursor } from "./actions";
import { Cell, active, columns, focusCell, refused, shownColumns } from "./WaypointCell";
import { goTo, select } from "../timeline/cursor";
import { number } from "../../core/format";
import { clearanceColour } from "../../plots/scales";
import { connected, doc, figures, figuresAreOld, plan, selected, touched, waypointAtCursor } from "../../core/store";
import { Arrange } from "./Arrange";
import { Velocity } from "./Velocity";
import type { Waypoint } from "../../core/protocol";
import { Gate } from "./Gate";

/** Where a selection by Shift begins. */
const anchor = signal<number | null>(null);

export function Waypoints() {
  const waypoints = doc.value?.waypoints ?? [];
  if (waypoints.length === 0) {
    return (
      <div class="empty">
        <p>No waypoints yet. Insert the first one, open a saved trajectory, or take those of a recorded path.</p>
        <Buttons count={0} />
        <Arrange />
      </div>
    );
  }
  return (
    <>
      <ColumnChoice />
      <div class="table-scroll">
        <table
          class={`table waypoints ${shownColumns.value}`}
          role="grid"
          aria-multiselectable="true"
          aria-label="Waypoints"
          onKeyDown={moveRow}
        >
          <thead>
            <tr>
              <th scope="col">#</th>
              {columns.value.map(({ key, label, unit, says }) => (
                <th key={key} scope="col" class={key} title={says}>
                  {label} <span class="unit">{unit}</span>
                </th>
              ))}
              <th scope="col" class="wide">
                v <span class="unit">m/s</span>
              </th>
              <th scope="col">
                clear <span class="unit">m</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {waypoints.map((waypoint, index) => (
              <Row key={waypoint.id} waypoint={waypoint} index={index} />
            ))}
          </tbody>
        </table>
      </div>
      {shownColumns.value === "requests" && <Velocity />}
      <Gate />
      <Buttons count={waypoints.length} />
      <Arrange />
    </>
  );
}

const CHOICES = [
  { key: "position", name: "Position" },
  { key: "requests", name: "Requests" },
] as const;

function ColumnChoice() {
  return (
    <div class="column-choice" role="group" aria-label="Columns">
      {CHOICES.map(({ key, name }) => (
        <button
          key={key}
          type="button"
          class="toggle"
          aria-pressed={shownColumns.value === key}
          onClick={() => (shownColumns.value = key)}
        >
          {name}
        </button>
      ))}
    </div>
  );
}

/** What is asked at a waypoint beside position and heading, in words; empty for nothing. */
function requestWords({ stay_s, fly_by_m, leg_speed_m_s, leg_jerk_m_s3, velocity_m_s, gate }: Waypoint): string {
  const words = [];
  if (stay_s > 0) words.push(`stays ${number(stay_s, 1)} s`);
  if (fly_by_m > 0) words.push(`passed within ${number(fly_by_m, 2)} m`);
  if (leg_speed_m_s !== null) words.push(`then at most ${number(leg_speed_m_s, 1)} m/s`);
  if (leg_jerk_m_s3 !== null) words.push(`then a jerk of at most ${number(leg_jerk_m_s3, 0)} m/s³`);
  if (velocity_m_s !== null) words.push(`velocity ${velocity_m_s.map((v) => number(v, 2)).join(", ")} m/s`);
  if (gate !== null) words.push(`gate of ${number(gate.width_m, 2)} × ${number(gate.height_m, 2)} m`);
  return words.join("; ");
}

function Buttons({ count }: { count: number }) {
  const chosen = selected.value.size;
  return (
    <div class="table-buttons">
      <button type="button" class="control" disabled={!connected.value} onClick={insertAfterSelected}>
        {count === 0 ? "Insert the first" : "Insert after"}
      </button>
      <button
        type="button"
        class="control"
        disabled={!canSplit()}
        title="A waypoint on the path at the cursor, between two of them"
        onClick={splitAtCursor}
      >
        Split
      </button>
      <button type="button" class="control" disabled={!connected.value || chosen === 0} onClick={deleteSelected}>
        Delete
      </button>
      <button type="button" class="control" disabled={!connected.value || count < 2} onClick={reverse}>
        Reverse
      </button>
      <span class="quiet">{chosen > 1 ? `${chosen} selected; an edit sets all` : ""}</span>
    </div>
  );
}

function Row({ waypoint, index }: { waypoint: Waypoint; index: number }) {
  const { id } = waypoint;
  const isSelected = useComputed(() => selected.value.has(id)).value;
  const isAt = useComputed(() => waypointAtCursor.value === id).value;
  const author = useComputed(() => touched.value.get(id)).value;
  const refusal = useComputed(() => (refused.value?.id === id ? refused.value.sentence : "")).value;
  const isProblem = useComputed(() => plan.value?.problem?.waypoint === id).value;
  const passing = useComputed(() => figures.value?.passings.find((each) => each.waypoint === id)).value;
  const isOld = figuresAreOld.value;
  const required_m = figures.value?.required_clearance_m ?? 0;
  const asked = requestWords(waypoint);
  return (
    <>
      <tr
        class={`${isAt ? "at" : ""} ${author === undefined ? "" : "touched"}`}
        aria-selected={isSelected}
        data-waypoint={id}
        onClick={(event) => choose(event, id)}
      >
        <th scope="row">
          {author ?? index + 1}
          {isProblem && <span class="danger-text"> !</span>}
          {asked !== "" && (
            <span class="asked" title={asked}>
              <span class="visually-hidden">{asked}</span>
            </span>
          )}
        </th>
        {columns.value.map((column) => (
          <Cell key={column.key} waypoint={waypoint} column={column} index={index} />
        ))}
        <td class={`wide dim ${isOld ? "old" : ""}`}>{number(passing?.speed_m_s, 1)}</td>
        <td class={isOld ? "old" : ""}>
          {passing !== undefined && (
            <span class="tick" style={{ background: clearanceColour(passing.clearance_m, required_m) }} />
          )}
          {number(passing?.clearance_m, 2)}
        </td>
      </tr>
      {refusal !== "" && (
        <tr class="refusal-row">
          <td colSpan={3 + columns.value.length} role="alert">
            {refusal}
          </td>
        </tr>
      )}
    </>
  );
}

/**
 * A click selects a row, Ctrl adds or takes away, Shift selects up to here; plots and 3D view go there.
 * A click into one of several selected rows leaves them selected, so that a cell can be edited for all of them.
 */
function choose(event: MouseEvent, id: number): void {
  const ids = (doc.value?.waypoints ?? []).map((waypoint) => waypoint.id);
  if (event.shiftKey && anchor.value !== null && ids.includes(anchor.value)) {
    const [from, to] = [ids.indexOf(anchor.value), ids.indexOf(id)].sort((a, b) => a - b) as [number, number];
    select(ids.slice(from, to + 1));
    return;
  }
  anchor.value = id;
  if (event.ctrlKey || event.metaKey) {
    const chosen = new Set(selected.value);
    if (!chosen.delete(id)) chosen.add(id);
    select(chosen);
    return;
  }
  const isInNumber = event.target instanceof Element && event.target.closest("th") !== null;
  if (isInNumber || !selected.value.has(id)) select([id]);
  const passing = figures.value?.passings.find((each) => each.waypoint === id);
  if (passing !== undefined) goTo(passing.time_s);
}

/** Alt with up and down goes to the neighbouring row; plain arrows move the waypoint itself. */
function moveRow(event: KeyboardEvent): void {
  const by = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
  const ids = (doc.value?.waypoints ?? []).map((waypoint) => waypoint.id);
  const from = active.value;
  if (!event.altKey || by === 0 || from === null) return;
  event.preventDefault();
  const next = ids[ids.indexOf(from.id) + by];
  if (next === undefined) return;
  select([next]);
  focusCell(next, from.column);
}
