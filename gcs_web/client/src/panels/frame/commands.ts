/** Every command of the page with its name and keys: the palette lists them, `keys.ts` listens for them. */

import type { PageCommand } from "../../core/panel";
import { connected, devicesOpen, paletteOpen, projectsOpen, step } from "../../core/store";
import { nextTheme } from "../../core/theme";
import { abort } from "../fly/orders";
import { LOOK_COMMANDS } from "../view/view";
import { PANELS } from "./panels";

const always = (): boolean => true;

export const COMMANDS: readonly PageCommand[] = [
  { name: "Abort: land at once", keys: ["Shift+Escape"], everywhere: true, enabled: always, run: () => void abort() },
  {
    name: "Commands",
    keys: ["Ctrl+k"],
    everywhere: true,
    enabled: always,
    run: () => (paletteOpen.value = !paletteOpen.value),
  },
  ...PANELS.map(({ step: number, name }): PageCommand => ({
    name: number === 0 ? "Start: what this project has" : `Step ${number}: ${name}`,
    keys: [String(number)],
    enabled: always,
    run: () => (step.value = number),
  })),
  ...PANELS.flatMap((panel) => panel.commands ?? []),
  ...LOOK_COMMANDS,
  { name: "Open another project", enabled: () => connected.value, run: () => (projectsOpen.value = true) },
  { name: "Let another device in: QR code", keys: ["q"], enabled: () => connected.value, run: () => (devicesOpen.value = true) },
  { name: "Dark, light or the system's colours", enabled: always, run: nextTheme },
];
