/** What fills an empty project: a form that is opened, a file that is chosen or dropped, a vehicle that is connected. */

import { computed, effect, signal } from "@preact/signals";
import { sendFile } from "../../core/files";
import { remembered } from "../../core/remembered";
import { send, submit } from "../../core/socket";
import { announce, files, flights, step } from "../../core/store";
import { takeFile } from "../compare/flights";
import { chosenKind } from "../jobs/Jobs";

export const START_STEP = 0;
/** Meshes, points, and ROS' maps of one height with their image. */
export const SHAPES = [".ply", ".obj", ".stl", ".glb", ".pcd", ".yaml", ".yml", ".pgm", ".png"];
export const VEHICLES = [".params", ".param", ".parm", ".urdf", ".xml", ".txt"];

const isText = (value: unknown): value is string => typeof value === "string";

/** Of the vehicle that was connected last. */
export const address = remembered("vehicle", "udp://127.0.0.1:14550", isText);
/** Where the poses of a vehicle of other firmware arrive. */
export const poses = remembered("poses", "udp://127.0.0.1:7777", isText);
/** Whether a vehicle at the address is flown by poses that come beside its own messages. */
export const needsPoses = computed(() => /^\s*(betaflight|mavlink):/.test(address.value));
export const addressOpen = signal(false);

/** Show the form of a job where the project is filled. */
export function openForm(kind: string): void {
  void submit({ type: "list_jobs" }); // files may have come since
  chosenKind.value = kind;
  step.value = START_STEP;
}

export function openAddress(): void {
  addressOpen.value = true;
  step.value = START_STEP;
}

/** Send a mesh, points, a vehicle or a log, and go on with what reads it. */
export async function takeAny(file: File): Promise<void> {
  const ends = (kinds: readonly string[]): boolean => kinds.some((kind) => file.name.toLowerCase().endsWith(kind));
  const form = ends(SHAPES) ? "import_map" : ends(VEHICLES) ? "new_vehicle" : null;
  if (form === null) return await takeFile(file);
  const error = await sendFile(file);
  if (error !== "") return announce(error, "danger");
  announce(`${file.name} is here: say how it is to be read.`);
  openForm(form);
}

export async function connectTo(url: string): Promise<string> {
  const { error } = await send({ type: "connect", url, poses: url !== "" && needsPoses.peek() ? poses.peek() : "" });
  if (error === "") addressOpen.value = false;
  return error;
}

/** A project that has next to nothing opens where it is filled, unless the address names a step or a key did. */
export function startWhereItLacks(): void {
  if (location.hash !== "") return;
  const first = step.value;
  const stop = effect(() => {
    if (flights.value === null) return; // told after the files
    const { has_map, has_vehicle } = files.value;
    const lacks = flights.value.flights.length === 0 && !(has_map && has_vehicle);
    if (lacks && step.peek() === first) step.value = START_STEP;
    queueMicrotask(() => stop());
  });
}
