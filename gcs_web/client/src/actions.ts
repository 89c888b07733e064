/** What the pilot can do to the document and the vehicle, whoever asks: button, key or palette. */

import { signal } from "@preact/signals";
import { edit, submit, send } from "./socket";
import type { EditToSend } from "./socket";
import { aborting, announce, document, selected } from "./store";
import type { Order, Reply } from "./protocol";

/** Send a change and put a refusal into the notice. */
export async function change(command: EditToSend): Promise<void> {
  const { error } = await edit(command);
  if (error !== "") announce(error, "danger");
}

// --- waypoints ---

/** Ids of the selected waypoints in the order they are flown. */
export function selectedInOrder(): number[] {
  return (document.value?.waypoints ?? []).map((waypoint) => waypoint.id).filter((id) => selected.value.has(id));
}

export function insertAfterSelected(): void {
  void change({ type: "insert", after: selectedInOrder().at(-1) ?? document.value?.waypoints.at(-1)?.id ?? null });
}

export function deleteSelected(): void {
  void change({ type: "delete", waypoints: selectedInOrder() });
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

/** An upload that was prepared: what the vehicle holds, what it would get, and the word that lets it through. */
export const upload = signal<Reply | null>(null);

export async function prepareUpload(): Promise<void> {
  const reply = await send({ type: "prepare_upload" });
  if (reply.error !== "") announce(reply.error, "danger");
  else upload.value = reply;
}

export async function confirmUpload(): Promise<void> {
  const prepared = upload.value;
  if (prepared === null) return;
  upload.value = null; // its nonce is used up, whatever the answer
  await submit({ type: "upload", nonce: prepared.nonce });
}

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
