/** The step Plan, and its commands. */

import type { PageCommand, Panel } from "../../core/panel";
import { submit } from "../../core/socket";
import { doc, selected, series, step } from "../../core/store";
import { canUpload, goToUpload, uploading } from "../fly/orders";
import {
  canEdit,
  canSave,
  canSplit,
  deleteSelected,
  insertAfterSelected,
  randomYaw,
  reverse,
  saveFormOpen,
  shiftSelected,
  splitAtCursor,
} from "./actions";
import { playing, select, togglePlaying } from "../timeline/cursor";
import { Drawer } from "../timeline/Drawer";
import { Plan } from "./Plan";
import { SaveForm } from "./SaveForm";

/** The step that plays flights. */
const COMPARE = 4;

const editsSelection = (): boolean => canEdit() && step.value === 2 && selected.value.size > 0;

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

const COMMANDS: readonly PageCommand[] = [
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
  { name: "Compare with the vehicle and upload", keys: ["u"], enabled: () => canUpload.value && uploading.value === null, run: goToUpload },
  { name: "Insert a waypoint after", keys: ["Insert", "+"], enabled: canEdit, run: insertAfterSelected },
  { name: "Delete the selected waypoints", keys: ["Delete"], enabled: editsSelection, run: deleteSelected },
  { name: "Split the path at the cursor", enabled: canSplit, run: splitAtCursor },
  { name: "Random headings, to learn the vehicle from", enabled: canEdit, run: randomYaw },
  { name: "Reverse the order of the waypoints", enabled: canEdit, run: reverse },
  {
    name: "Select all waypoints",
    keys: ["Ctrl+a"],
    enabled: () => canEdit() && step.value === 2,
    run: () => select((doc.value?.waypoints ?? []).map((waypoint) => waypoint.id)),
  },
  {
    name: "Play or pause the plan",
    keys: ["Space", "k"],
    enabled: () => series.value !== null && step.value !== COMPARE,
    run: togglePlaying,
  },
  {
    name: "Clear the selection",
    keys: ["Escape"],
    enabled: () => step.value === 2 && selected.value.size > 0,
    run: () => {
      playing.value = false;
      select([]);
    },
  },
  ...shifts,
];

const Dialog = () => (saveFormOpen.value ? <SaveForm /> : null);

export const PLAN: Panel = { step: 2, name: "Plan", inspector: Plan, drawer: Drawer, dialog: Dialog, commands: COMMANDS };
