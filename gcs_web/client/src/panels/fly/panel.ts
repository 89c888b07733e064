/** The step Fly, and its commands. */

import type { PageCommand, Panel } from "../../core/panel";
import { connected, inControl, step, vehicle } from "../../core/store";
import { Drawer } from "../timeline/Drawer";
import { Fly } from "./Fly";
import { giveOrder } from "./orders";

const inFlight = (): boolean => connected.value && step.value === 3 && inControl.value && vehicle.value?.armed === true;

const COMMANDS: readonly PageCommand[] = [
  { name: "Pause and hover", keys: ["p"], enabled: inFlight, run: () => void giveOrder("pause") },
  { name: "Land here", keys: ["l"], enabled: inFlight, run: () => void giveOrder("land") },
];

export const FLY: Panel = { step: 3, name: "Fly", inspector: Fly, drawer: Drawer, commands: COMMANDS };
