/** The step Fly, and its commands. */

import type { PageCommand, Panel } from "../../core/panel";
import { connected, hasVehicle, isArmed, vehicle } from "../../core/store";
import { Drawer } from "../timeline/Drawer";
import { muted } from "./alarm";
import { Fly } from "./Fly";
import { giveOrder, isFree, mayOrder, takeControl } from "./orders";

const inFlight = (): boolean => mayOrder.value && vehicle.value?.armed === true;

const COMMANDS: readonly PageCommand[] = [
  { name: "Take control", keys: ["c"], enabled: () => connected.value && hasVehicle.value && isFree.value, run: takeControl },
  { name: "Pause and hover", keys: ["p"], overDialogs: true, enabled: inFlight, run: () => void giveOrder("pause") },
  { name: "Mute or sound alarms", keys: ["n"], enabled: () => isArmed.value, run: () => (muted.value = !muted.value) },
  { name: "Land here", keys: ["l"], overDialogs: true, enabled: inFlight, run: () => void giveOrder("land") },
];

export const FLY: Panel = { step: 3, name: "Fly", inspector: Fly, drawer: Drawer, commands: COMMANDS };
