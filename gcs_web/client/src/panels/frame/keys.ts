/** The keyboard: finds the command of a key, on the page and inside the 3D view. */

import { COMMANDS } from "./commands";
import type { PageCommand } from "../../core/panel";

const byKeys = new Map(COMMANDS.flatMap((command) => (command.keys ?? []).map((keys) => [keys, command] as const)));

/** Elements that use plain keys themselves. */
const TYPED_INTO = "input, textarea, select, [role=tab], [role=separator], [role=dialog]";

/** Keys that the 3D view needs for its camera. */
const KEYS_OF_CAMERA = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "p", "l"]);

function name(event: KeyboardEvent): string {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const shift = event.shiftKey && (event.key.length > 1 || event.ctrlKey || event.metaKey);
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${shift ? "Shift+" : ""}${key}`;
}

function isTypedInto(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest(TYPED_INTO) !== null;
}

function run(event: KeyboardEvent, command: PageCommand): void {
  if (!command.enabled()) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  command.run();
}

export function listen(): void {
  // Abort first of all: nothing on the page may swallow it.
  addEventListener(
    "keydown",
    (event) => {
      const command = byKeys.get(name(event));
      if (command?.everywhere === true) run(event, command);
    },
    { capture: true },
  );
  addEventListener("keydown", (event) => {
    const command = byKeys.get(name(event));
    if (command !== undefined && !event.defaultPrevented && !isTypedInto(event.target)) run(event, command);
  });
}

/** Commands while the 3D view has the focus; the window is of this origin. */
export function listenIn(view: Window): void {
  view.addEventListener(
    "keydown",
    (event) => {
      const command = byKeys.get(name(event));
      if (command !== undefined && !KEYS_OF_CAMERA.has(event.key)) run(event, command);
    },
    { capture: true },
  );
}
