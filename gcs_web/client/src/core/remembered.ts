/** Choices of this browser that outlive a reload. */

import { effect, signal } from "@preact/signals";
import type { Signal } from "@preact/signals";

const PREFIX = "goshawk.";

/** A signal kept in localStorage; holds `initial` where nothing usable is stored. */
export function remembered<T>(key: string, initial: T, isUsable: (value: unknown) => value is T): Signal<T> {
  const kept = signal(read(key, initial, isUsable));
  effect(() => {
    const text = JSON.stringify(kept.value);
    try {
      localStorage.setItem(PREFIX + key, text);
    } catch {
      // storage is refused or full: the choice lasts until the page is closed
    }
  });
  return kept;
}

function read<T>(key: string, initial: T, isUsable: (value: unknown) => value is T): T {
  try {
    const value: unknown = JSON.parse(localStorage.getItem(PREFIX + key) ?? "null");
    return isUsable(value) ? value : initial;
  } catch {
    return initial;
  }
}
