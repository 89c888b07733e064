/** Every command of the page with its name and keys: the palette lists them, `keys.ts` listens for them. */

import { abort, giveOrder, openUpload } from "../fly/orders";
import {
  canEdit,
  canSave,
  canSplit,
  canUpload,
  deleteSelected,
  insertAfterSelected,
  randomYaw,
  reverse,
  saveFormOpen,
  shiftSelected,
  splitAtCursor,
} from "../plan/actions";
import { playing, select, togglePlaying } from "../plan/cursor";
import { cancel, draft, painting } from "../map/editing";
import { TOOLS } from "../map/tools";
import { submit } from "../../core/socket";
import {
  connected,
  doc,
  inControl,
  paletteOpen,
  projectsOpen,
  selected,
  series,
  step,
  vehicle,
} from "../../core/store";
import { nextTheme } from "../../core/theme";

export interface PageCommand {
  name: string;
  /** As `keys.ts` writes an event, e.g. "Ctrl+Shift+z"; several if one does not fit all keyboards. */
  keys?: readonly string[];
  /** Also while typing in a field. */
  everywhere?: boolean;
  enabled: () => boolean;
  run: () => void;
}

export const STEPS = [
  { number: 1, name: "Map" },
  { number: 2, name: "Plan" },
  { number: 3, name: "Fly" },
  { number: 4, name: "Compare" },
  { number: 5, name: "Learn" },
] as const;

const always = (): boolean => true;
const editsSelection = (): boolean => canEdit() && step.value === 2 && selected.value.size > 0;
const inFlight = (): boolean => connected.value && step.value === 3 && inControl.value && vehicle.value?.armed === true;

const SHIFT_KEYS: readonly [key: string, name: string, x: number, y: number, z: number][] = [
  ["ArrowRight", "x up", 1, 0, 0],
  ["ArrowLeft", "x down", -1, 0, 0],
  ["ArrowUp", "y up", 0, 1, 0],
  ["ArrowDown", "y down", 0, -1, 0],
  ["PageUp", "higher", 0, 0, 1],
  ["PageDown", "lower", 0, 0, -1],
];

const shifts = [0.1, 1].flatMap((step_m) =>
  SHIFT_KEYS.map(([key, name, x, y, z]): PageCommand => ({
    name: `Shift waypoints ${step_m} m: ${name}`,
    keys: [step_m === 1 ? `Shift+${key}` : key],
    enabled: editsSelection,
    run: () => shiftSelected(x * step_m, y * step_m, z * step_m),
  })),
);

export const COMMANDS: readonly PageCommand[] = [
  { name: "Abort: land at once", keys: ["Shift+Escape"], everywhere: true, enabled: always, run: () => void abort() },
  {
    name: "Commands",
    keys: ["Ctrl+k"],
    everywhere: true,
    enabled: always,
    run: () => (paletteOpen.value = !paletteOpen.value),
  },
  ...STEPS.map(({ number, name }): PageCommand => ({
    name: `Step ${number}: ${name}`,
    keys: [String(number)],
    enabled: always,
    run: () => (step.value = number),
  })),
  {
    name: "Undo",
    keys: ["Ctrl+z"],
    enabled: () => canEdit() && doc.value?.undo !== "",
    run: () => void submit({ type: "undo" }),
  },
  {
    name: "Redo",
    keys: ["Ctrl+Shift+z", "Ctrl+y"],
    enabled: () => canEdit() && doc.value?.redo !== "",
    run: () => void submit({ type: "redo" }),
  },
  {
    name: "Save the trajectory",
    keys: ["Ctrl+s"],
    everywhere: true,
    enabled: canSave,
    run: () => (saveFormOpen.value = true),
  },
  { name: "Plan and check again", enabled: canEdit, run: () => void submit({ type: "plan_again" }) },
  { name: "Compare with the vehicle and upload", enabled: canUpload, run: openUpload },
  { name: "Insert a waypoint after", keys: ["Insert", "+"], enabled: canEdit, run: insertAfterSelected },
  { name: "Delete the selected waypoints", keys: ["Delete"], enabled: editsSelection, run: deleteSelected },
  { name: "Split the path at the cursor", enabled: canSplit, run: splitAtCursor },
  { name: "Random headings, to learn the vehicle from", enabled: canEdit, run: randomYaw },
  { name: "Open another project", enabled: () => connected.value, run: () => (projectsOpen.value = true) },
  { name: "Reverse the order of the waypoints", enabled: canEdit, run: reverse },
  {
    name: "Select all waypoints",
    keys: ["Ctrl+a"],
    enabled: () => canEdit() && step.value === 2,
    run: () => select((doc.value?.waypoints ?? []).map((waypoint) => waypoint.id)),
  },
  {
    name: "Play or pause the plan",
    enabled: () => series.value !== null,
    run: togglePlaying,
  },
  { name: "Pause and hover", keys: ["p"], enabled: inFlight, run: () => void giveOrder("pause") },
  { name: "Land here", keys: ["l"], enabled: inFlight, run: () => void giveOrder("land") },
  { name: "Dark, light or the system's colours", enabled: always, run: nextTheme },
  {
    name: "Clear the selection",
    keys: ["Escape"],
    enabled: () => step.value === 2 && selected.value.size > 0,
    run: () => {
      playing.value = false;
      select([]);
    },
  },
  ...TOOLS.map(({ name, key, run }): PageCommand => ({
    name: `Map: ${name.toLowerCase()}`,
    keys: [key],
    enabled: () => canEdit() && step.value === 1,
    run,
  })),
  { name: "Map: cancel the edit", enabled: () => step.value === 1 && (draft.value !== null || painting.value), run: cancel },
  ...shifts,
];
