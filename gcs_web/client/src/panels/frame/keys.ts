/** The keyboard: finds the command of a key, on the page and inside the 3D view. */

import { COMMANDS } from "./commands";
import type { PageCommand } from "../../core/panel";

/** Elements that use plain keys themselves. */
const TYPED_INTO = "input:not([type=checkbox], [type=radio]), textarea, select";
const DIALOG = "[role=dialog]";

/** Elements that use some of them. */
const MOVED_WITHIN = "[role=tab], [role=separator], [type=radio]";
const PRESSED = "button, summary, a, [type=checkbox], [type=radio]";

/** Keys that the 3D view needs for its camera. */
const KEYS_OF_CAMERA = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", ..."wasdqe"]);

function name(event: KeyboardEvent): string {
  if (event.altKey && event.key.length === 1) return ""; // a menu's, or a letter of another keyboard
  if (event.key === " ") return "Space";
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const shift = event.shiftKey && (event.key.length > 1 || event.ctrlKey || event.metaKey);
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${shift ? "Shift+" : ""}${key}`;
}

/** The command of a key that can be given now; several steps may share a key. */
function commandOf(event: KeyboardEvent): PageCommand | undefined {
  const keys = name(event);
  return COMMANDS.find((command) => command.keys?.includes(keys) === true && command.enabled());
}

function isUsedBy(target: EventTarget | null, event: KeyboardEvent, { overDialogs }: PageCommand): boolean {
  if (!(target instanceof Element)) return false;
  if (target.closest(TYPED_INTO) !== null) return true;
  if (target.closest(DIALOG) !== null && overDialogs !== true) return true;
  return target.closest(event.key.startsWith("Arrow") ? MOVED_WITHIN : event.key === " " ? PRESSED : TYPED_INTO) !== null;
}

/** Keys that go on while they are held: steps, and undo. */
const REPEATS = /Arrow|Page|^Ctrl\+(Shift\+)?[zy]$/;

function run(event: KeyboardEvent, command: PageCommand): void {
  event.preventDefault();
  event.stopImmediatePropagation();
  if (!event.repeat || REPEATS.test(name(event))) command.run();
}

export function listen(): void {
  // Abort first of all: nothing on the page may swallow it.
  addEventListener(
    "keydown",
    (event) => {
      const command = commandOf(event);
      if (command?.everywhere === true) run(event, command);
    },
    { capture: true },
  );
  addEventListener("keydown", (event) => {
    const command = commandOf(event);
    if (command !== undefined && !event.defaultPrevented && !isUsedBy(event.target, event, command)) run(event, command);
  });
}

/** Commands while the 3D view has the focus; the window is of this origin. */
export function listenIn(view: Window): void {
  view.addEventListener(
    "keydown",
    (event) => {
      const command = commandOf(event);
      if (command !== undefined && !KEYS_OF_CAMERA.has(event.key)) run(event, command);
    },
    { capture: true },
  );
}
