/** Orders to the vehicle, and the upload before them. */

import { computed, effect, signal } from "@preact/signals";
import { edit, send, submit } from "../../core/socket";
import { aborting, announce, connected, doc, hasVehicle, inControl, link, people, plan, step, vehicle, verdict } from "../../core/store";
import type { Order, Reply } from "../../core/protocol";

/**
 * How far an upload is: `prepared` has what the vehicle holds, what it would get, and the nonce that lets it through,
 * which is used up by sending whatever the answer.
 */
export type UploadState =
  | { stage: "control" | "comparing" | "sending" }
  | { stage: "refused"; error: string }
  | { stage: "prepared"; reply: Reply };

const [PLAN_STEP, FLY_STEP] = [2, 3];

/** Null while the upload panel is closed. */
export const uploading = signal<UploadState | null>(null);

/** Whether there is a checked plan, and a vehicle to take it. */
export const canUpload = computed(() => verdict.value === "checked" && hasVehicle.value);

/** Open the panel in a step that shows it. */
export function goToUpload(): void {
  if (step.value !== PLAN_STEP) step.value = FLY_STEP;
  openUpload();
}

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

/** While the new beginning is on its way: another press would insert the same place twice. */
const beginning = signal(false);

/** Whether the plan that is shown is the one that the failed check is about. */
export const canBeginHere = computed(() => verdict.value === "checked" && !beginning.value);

/** Begin the plan above where the vehicle stands, at the height of its first waypoint. */
export async function beginHere(): Promise<void> {
  if (!canBeginHere.value) return;
  const [last, first] = [vehicle.value, doc.value?.waypoints[0]];
  if (last === null || last.x_m === null || last.y_m === null || first === undefined) return;
  const place = { x_m: Number(last.x_m.toFixed(2)), y_m: Number(last.y_m.toFixed(2)), z_m: first.z_m };
  beginning.value = true;
  const { error } = await edit({ type: "insert", after: null, ...place });
  beginning.value = false;
  if (error === "") announce("The plan begins where the vehicle stands: it is checked anew; then upload it.");
  else announce(error, "danger");
}

/** Whether nobody gives the orders. */
export const isFree = computed(() => people.value.in_control === "");

/** From nobody; who takes it over meanwhile keeps it. */
export function takeControl(): void {
  void submit({ type: "take_control", force: false });
}

/** From the person whom the page names. */
export function takeOver(): void {
  void submit({ type: "take_control", force: true });
}

/** Whether this person's orders can reach the vehicle. */
export const mayOrder = computed(
  () => connected.value && inControl.value && link.value.state !== "none" && vehicle.value !== null,
);

export async function giveOrder(what: Order["order"]): Promise<void> {
  const crc32 = plan.value?.crc32 ?? ""; // as it is seen now
  const { error, nonce } = await send({ type: "prepare_order" });
  if (error !== "") announce(error, "danger");
  else await submit({ type: "order", order: what, nonce, crc32 });
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
