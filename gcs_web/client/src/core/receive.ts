/** What is done with each message of the server; replies to commands go to `socket.ts`. */

import { batch, signal } from "@preact/signals";
import type { Signal } from "@preact/signals";
import type { ToPage } from "./protocol";

export type Received = Exclude<ToPage, { type: "reply" }>;
type Of<T extends Received["type"]> = Extract<Received, { type: T }>;

const takers = new Map<Received["type"], (message: never) => void>();

/** Have messages of a type taken in. */
export function on<T extends Received["type"]>(type: T, take: (message: Of<T>) => void): void {
  takers.set(type, take);
}

/** The newest message of a type, `initial` until the first one. */
export function newest<T extends Received["type"]>(type: T, initial: Of<T>): Signal<Of<T>>;
export function newest<T extends Received["type"]>(type: T, initial: null): Signal<Of<T> | null>;
export function newest<T extends Received["type"]>(type: T, initial: Of<T> | null): Signal<Of<T> | null> {
  const kept = signal(initial);
  on(type, (message) => (kept.value = message));
  return kept;
}

export function receive(message: Received): void {
  batch(() => takers.get(message.type)?.(message as never));
}
