/** One editable cell of the table of waypoints. */

import { computed, effect, signal, useComputed } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { selectedInOrder } from "./actions";
import { editable, number, parse } from "../../core/format";
import { edit } from "../../core/socket";
import { connected, doc, selected } from "../../core/store";
import type { Waypoint } from "../../core/protocol";

type RequestKey = "stay_s" | "fly_by_m" | "leg_speed_m_s" | "leg_jerk_m_s3";
type ColumnKey = "x_m" | "y_m" | "z_m" | "yaw_deg" | RequestKey;

interface Column {
  key: ColumnKey;
  label: string;
  unit: string;
  digits: number;
  /** What it means, where the label is short. */
  says?: string;
}

const POSITION: readonly Column[] = [
  { key: "x_m", label: "x", unit: "m", digits: 2 },
  { key: "y_m", label: "y", unit: "m", digits: 2 },
  { key: "z_m", label: "z", unit: "m", digits: 2 },
  { key: "yaw_deg", label: "yaw", unit: "°", digits: 0 },
];
const REQUESTS: readonly Column[] = [
  { key: "yaw_deg", label: "yaw", unit: "°", digits: 0 },
  { key: "stay_s", label: "stay", unit: "s", digits: 1, says: "Hover here for so long" },
  { key: "fly_by_m", label: "within", unit: "m", digits: 2, says: "It is enough to pass within this radius" },
  { key: "leg_speed_m_s", label: "then ≤", unit: "m/s", digits: 1, says: "Largest speed to the next waypoint" },
  { key: "leg_jerk_m_s3", label: "jerk ≤", unit: "m/s³", digits: 0, says: "Largest jerk to the next waypoint" },
];

/** Which columns the table has: where the waypoints are, or what is asked there. */
export const shownColumns = signal<"position" | "requests">("position");
export const columns = computed(() => (shownColumns.value === "position" ? POSITION : REQUESTS));

const isRequest = (key: ColumnKey): key is RequestKey =>
  key === "stay_s" || key === "fly_by_m" || key === "leg_speed_m_s" || key === "leg_jerk_m_s3";

/** What stands in a cell; null where nothing is asked. */
function valueOf(waypoint: Waypoint, key: ColumnKey): number | null {
  const value = waypoint[key];
  return isRequest(key) && value === 0 ? null : value;
}

interface Place {
  id: number;
  column: ColumnKey;
}

/** The cell that has, or last had, the focus. */
export const active = signal<Place | null>(null);
effect(() => {
  const waypoints = doc.value?.waypoints ?? [];
  if (active.value !== null && !waypoints.some(({ id }) => id === active.value?.id)) active.value = null;
});

/** The cell that is typed into, and the text it began with. */
const editing = signal<(Place & { text: string }) | null>(null);
/** What was typed and not taken, and why. */
export const refused = signal<(Place & { text: string; sentence: string }) | null>(null);

const isAt = (place: Place | null, id: number, column: ColumnKey): boolean =>
  place !== null && place.id === id && place.column === column;

/** The cell that gets the focus as soon as it is drawn again. */
let wanted: Place | null = null;

/** Give the focus to a cell, also to one that is still typed into. */
export function focusCell(id: number, column: ColumnKey): void {
  const cell = document.querySelector<HTMLElement>(`[data-cell="${id} ${column}"]`);
  if (cell === null) wanted = { id, column };
  else cell.focus();
}

interface Props {
  waypoint: Waypoint;
  column: Column;
  index: number;
}

export function Cell({ waypoint, column, index }: Props) {
  const { id } = waypoint;
  const { key } = column;
  const isActive = useComputed(() => isAt(active.value, id, key)).value;
  const hasNone = useComputed(() => active.value === null).value;
  const started = useComputed(() => (isAt(editing.value, id, key) ? editing.value?.text : undefined)).value;
  const refusal = useComputed(() => (isAt(refused.value, id, key) ? refused.value : null)).value;
  const value = valueOf(waypoint, key);
  const cell = useRef<HTMLTableCellElement>(null);
  useLayoutEffect(() => {
    if (cell.current === null || !isAt(wanted, id, key)) return;
    wanted = null;
    cell.current.focus();
  });

  const begin = (text: string): void => {
    if (connected.value) editing.value = { id, column: key, text };
  };
  const onKeyDown = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Enter" || event.key === "F2") begin(refusal?.text ?? editable(value));
    else if (event.key === "Escape" && refusal !== null) refused.value = null;
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  if (started !== undefined) {
    return (
      <td class={`edited ${key}`}>
        <Editor waypoint={waypoint} column={column} index={index} text={started} />
      </td>
    );
  }
  return (
    <td
      ref={cell}
      class={`cell ${key} ${refusal === null ? "" : "refused"}`}
      tabIndex={isActive || (hasNone && index === 0 && key === columns.value[0]?.key) ? 0 : -1}
      data-cell={`${id} ${key}`}
      aria-invalid={refusal !== null}
      onFocus={() => (active.value = { id, column: key })}
      onMouseDown={(event) => {
        const plain = !event.shiftKey && !event.ctrlKey && !event.metaKey;
        const again = plain && event.currentTarget === document.activeElement;
        if (again || event.shiftKey) event.preventDefault(); // else the browser takes the focus back, or selects text
        if (again) begin(refusal?.text ?? editable(value));
      }}
      onKeyDown={onKeyDown}
    >
      {refusal?.text ?? number(value, column.digits)}
    </td>
  );
}

function Editor({ waypoint, column, index, text }: Props & { text: string }) {
  const { id } = waypoint;
  const input = useRef<HTMLInputElement>(null);
  const left = useRef(false);
  useLayoutEffect(() => {
    input.current?.focus(); // before the next key arrives
    input.current?.select();
  }, []);

  const leave = (accept: boolean): void => {
    if (left.current) return;
    left.current = true;
    const typed = input.current?.value ?? "";
    if (isAt(editing.value, id, column.key)) editing.value = null;
    if (accept) void commit(waypoint, column, typed);
    else refused.value = null;
  };
  const onKeyDown = (event: KeyboardEvent): void => {
    if (event.key === "Enter" || event.key === "Escape") {
      leave(event.key === "Enter");
      focusCell(id, column.key);
    } else if (event.key === "Tab") {
      leave(true);
      editNeighbour(id, column.key, event.shiftKey ? -1 : 1);
    } else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <input
      ref={input}
      class="cell-input"
      aria-label={`${column.label} of waypoint ${index + 1}, ${column.unit}`}
      inputMode="decimal"
      autoComplete="off"
      defaultValue={text}
      onKeyDown={onKeyDown}
      onBlur={() => leave(true)}
      onClick={(event) => event.stopPropagation()}
    />
  );
}

/** Go on with the next or the previous cell, over the ends of rows. */
function editNeighbour(id: number, column: ColumnKey, by: 1 | -1): void {
  const waypoints = doc.value?.waypoints ?? [];
  const row = waypoints.findIndex((waypoint) => waypoint.id === id);
  const count = columns.value.length;
  const flat = row * count + columns.value.findIndex(({ key }) => key === column) + by;
  const next = waypoints[Math.floor(flat / count)];
  const nextColumn = columns.value[((flat % count) + count) % count];
  if (next === undefined || nextColumn === undefined) return focusCell(id, column);
  active.value = { id: next.id, column: nextColumn.key };
  editing.value = { ...active.value, text: editable(valueOf(next, nextColumn.key)) };
}

/** Set what was typed on the waypoint, or on all selected ones if it is among them. */
async function commit(waypoint: Waypoint, { key, unit }: Column, text: string): Promise<void> {
  if (text === editable(valueOf(waypoint, key))) {
    if (isAt(refused.value, waypoint.id, key)) refused.value = null;
    return;
  }
  const place = { id: waypoint.id, column: key, text };
  const value = parse(text);
  const isFree = (key === "yaw_deg" || isRequest(key)) && text.trim() === "";
  if (value === null && !isFree) {
    const example =
      key === "yaw_deg" ? "90, or nothing to let the planner choose" : isRequest(key) ? "1.5, or nothing" : "1.25";
    refused.value = { ...place, sentence: `“${text}” is not a number; type one in ${unit}, like ${example}.` };
    return;
  }
  const waypoints = selected.value.has(waypoint.id) ? selectedInOrder() : [waypoint.id];
  const { error } = await edit(
    key === "yaw_deg"
      ? { type: "turn", waypoints, yaw_deg: value }
      : isRequest(key)
        ? { type: "ask", waypoints, [key]: value ?? 0 }
        : { type: "move", waypoints, [key]: value },
  );
  refused.value = error === "" ? null : { ...place, sentence: error };
}
