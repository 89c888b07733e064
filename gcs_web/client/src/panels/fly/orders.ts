/** Orders to the vehicle, and the upload before them. */

import { computed, effect, signal } from "@preact/signals";
import { edit, send, submit } from "../../core/socket";
import { aborting, announce, connected, doc, hasVehicle, inControl, link, people, vehicle, verdict } from "../../core/store";
import type { Order, Reply } from "../../core/protocol";

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

/** Whether there is a checked plan, and a vehicle to take it. */
export const canUpload = computed(() => verdict.value === "checked" && hasVehicle.value);

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

/** Begin the plan above where the vehicle stands, at the height of its first waypoint. */
export async function beginHere(): Promise<void> {
  const [last, first] = [vehicle.value, doc.value?.waypoints[0]];
  if (last === null || last.x_m === null || last.y_m === null || first === undefined) return;
  const place = { x_m: Number(last.x_m.toFixed(2)), y_m: Number(last.y_m.toFixed(2)), z_m: first.z_m };
  const { error } = await edit({ type: "insert", after: null, ...place });
  if (error === "") announce("The plan begins where the vehicle stands: it is checked anew; then upload it.");
  else announce(error, "danger");
}

export function takeControl(): void {
  const isHeld = people.value.in_control !== "";
  void submit({ type: "take_control", force: isHeld });
}

/** Whether this person's orders can reach the vehicle. */
export const mayOrder = computed(
  () => connected.value && inControl.value && link.value.state !== "none" && vehicle.value !== null,
);

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

/** Stop the rotors, in the air too. */
export async function kill(): Promise<void> {
  const { error } = await send({ type: "kill" });
  if (error !== "") announce(`Kill: ${error}`, "danger");
}
