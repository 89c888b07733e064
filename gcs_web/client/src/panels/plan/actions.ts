/** What the pilot can do to the document, whoever asks: button, key or palette. */

import { computed, signal } from "@preact/signals";
import { edit } from "../../core/socket";
import type { EditToSend } from "../../core/socket";
import { select } from "../timeline/cursor";
import { announce, connected, cursor_s, doc, selected, series, verdict, waypointAtCursor } from "../../core/store";

/** Send a change and put a refusal into the notice. */
export async function change(command: EditToSend, revision?: number): Promise<void> {
  const { error } = await edit(command, revision);
  if (error !== "") announce(error, "danger");
}

// --- waypoints ---

/** Ids of the selected waypoints in the order they are flown. */
export function selectedInOrder(): number[] {
  return (doc.value?.waypoints ?? []).map((waypoint) => waypoint.id).filter((id) => selected.value.has(id));
}

let inserted: Promise<void> = Promise.resolve();

/** One after the other, and each new waypoint is selected: inserting again goes on from there. */
export function insertAfterSelected(): void {
  inserted = inserted.then(async () => {
    const there = new Set((doc.value?.waypoints ?? []).map(({ id }) => id));
    await change({ type: "insert", after: selectedInOrder().at(-1) ?? [...there].at(-1) ?? null });
    const added = (doc.value?.waypoints ?? []).filter(({ id }) => !there.has(id)); // the document comes before the reply
    if (added.length > 0) select(added.map(({ id }) => id));
  });
}

export function deleteSelected(): void {
  void change({ type: "delete", waypoints: selectedInOrder() });
}

/** Where a waypoint is already, the path is not split: two in one place are refused. */
const AT_WAYPOINT_M = 0.01;

interface Split {
  /** The waypoint that is passed last. */
  after: number;
  x_m: number;
  y_m: number;
  z_m: number;
}

/** The waypoint that splits the path at the cursor; null where there is no path, or a waypoint already. */
export const splitAt = computed((): Split | null => {
  const after = waypointAtCursor.value;
  const shown = series.value;
  const time_s = cursor_s.value;
  if (after === null || shown === null || time_s === null) return null;
  const at = shown.time_s.findLastIndex((each) => each <= time_s);
  const place = (values: readonly number[]): number => Number((values[at] ?? 0).toFixed(3));
  const [x_m, y_m, z_m] = [place(shown.x_m), place(shown.y_m), place(shown.z_m)];
  const isThere = (doc.value?.waypoints ?? []).some(
    (each) => Math.hypot(each.x_m - x_m, each.y_m - y_m, each.z_m - z_m) < AT_WAYPOINT_M,
  );
  return isThere ? null : { after, x_m, y_m, z_m };
});

export function splitAtCursor(): void {
  if (splitAt.value !== null) void change({ type: "insert", ...splitAt.value });
}

/** The selected waypoints, or all of them where none is. */
export function selectedOrAll(): number[] {
  const chosen = selectedInOrder();
  return chosen.length > 0 ? chosen : (doc.value?.waypoints ?? []).map(({ id }) => id);
}

export function randomYaw(): void {
  void change({ type: "random_yaw", waypoints: selectedOrAll() });
}

export function reverse(): void {
  void change({ type: "reverse" });
}

type Shifted = { waypoints: number[]; x_m: number; y_m: number; z_m: number };
let pending: Shifted | null = null;
let shifting = false;

/** Move the selected waypoints together; steps that come while one is on its way are added up. */
export function shiftSelected(x_m: number, y_m: number, z_m: number): void {
  const waypoints = selectedInOrder();
  if (waypoints.length === 0) return;
  const adds = pending !== null && pending.waypoints.join() === waypoints.join();
  if (pending !== null && !adds) void change({ type: "shift", ...pending });
  const before = adds && pending !== null ? pending : { x_m: 0, y_m: 0, z_m: 0 };
  pending = { waypoints, x_m: before.x_m + x_m, y_m: before.y_m + y_m, z_m: before.z_m + z_m };
  if (!shifting) void sendShifts();
}

async function sendShifts(): Promise<void> {
  shifting = true;
  while (pending !== null) {
    const next: Shifted = pending;
    pending = null;
    await change({ type: "shift", ...next });
  }
  shifting = false;
}

// --- what is possible now ---

export const canEdit = (): boolean => connected.value && doc.value !== null;
/** Whether the cursor is on the path of these waypoints, between two of them. */
export const canSplit = (): boolean => canEdit() && verdict.value === "checked" && splitAt.value !== null;
export const canSave = (): boolean => verdict.value === "checked";

/** Whether the form for saving is open; several parts open it. */
export const saveFormOpen = signal(false);
