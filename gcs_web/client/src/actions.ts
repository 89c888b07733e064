/** What the pilot can do to the document and the vehicle, whoever asks: button, key or palette. */

import { computed, effect, signal } from "@preact/signals";
import { edit, submit, send } from "./socket";
import type { EditToSend } from "./socket";
import { aborting, announce, cursor_s, doc, inControl, selected, series, waypointAtCursor } from "./store";
import type { Order, Reply } from "./protocol";

/** Send a change and put a refusal into the notice. */
export async function change(command: EditToSend): Promise<void> {
  const { error } = await edit(command);
  if (error !== "") announce(error, "danger");
}

// --- waypoints ---

/** Ids of the selected waypoints in the order they are flown. */
export function selectedInOrder(): number[] {
  return (doc.value?.waypoints ?? []).map((waypoint) => waypoint.id).filter((id) => selected.value.has(id));
}

export function insertAfterSelected(): void {
  void change({ type: "insert", after: selectedInOrder().at(-1) ?? doc.value?.waypoints.at(-1)?.id ?? null });
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

// --- saving and uploading: forms that other parts open ---

export const saveFormOpen = signal(false);

/**
 * How far an upload is: `prepared` has what the vehicle holds, what it would get, and the nonce that lets it through,
 * which is used up by sending whatever the answer.
 */
export type UploadState =
  | { stage: "control" | "comparing" | "sending" }
  | { stage: "refused"; error: string }
  | { stage: "prepared"; reply: Reply };

/** Null while the upload panel is closed. */
export const uploading = signal<UploadState | null>(null);

/** Open the panel; it compares as soon as this person is in control. */
export function openUpload(): void {
  uploading.value = { stage: "control" };
  if (inControl.value) void prepareUpload();
}

export async function prepareUpload(): Promise<void> {
  uploading.value = { stage: "comparing" };
  const reply = await send({ type: "prepare_upload" });
  if (uploading.value === null) return; // the panel was closed meanwhile
  uploading.value = reply.error === "" ? { stage: "prepared", reply } : { stage: "refused", error: reply.error };
}

export async function confirmUpload(nonce: string): Promise<void> {
  uploading.value = { stage: "sending" };
  const { error } = await send({ type: "upload", nonce });
  uploading.value = error === "" ? null : { stage: "refused", error };
}

effect(() => {
  if (inControl.value && uploading.peek()?.stage === "control") void prepareUpload();
});

// --- the vehicle ---

export async function giveOrder(what: Order["order"]): Promise<void> {
  const { error, nonce } = await send({ type: "prepare_order" });
  if (error !== "") announce(error, "danger");
  else await submit({ type: "order", order: what, nonce });
}

export async function abort(): Promise<void> {
  aborting.value = true;
  const { error } = await send({ type: "abort" });
  aborting.value = false;
  if (error !== "") announce(`Abort: ${error}`, "danger");
}
