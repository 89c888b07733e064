/** How the vehicle and its surroundings are looked at: in 3D, in 3D with a camera that follows, or on a map from above. */

import { computed, effect, signal } from "@preact/signals";
import { canDraw } from "../../core/machine";
import type { PageCommand } from "../../core/panel";
import { remembered } from "../../core/remembered";
import { submit } from "../../core/socket";
import { connected, hasVehicle } from "../../core/store";

const LOOKS = ["3d", "follow", "top"] as const;
export type Look = (typeof LOOKS)[number];

const isLook = (value: unknown): value is Look => LOOKS.some((each) => each === value);

/** Of this page's 3D view; the station moves its camera by it. */
export const VIEW = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, "0")).join("");

const chosen = remembered<Look>("look", "3d", isLook);

/** Whether the 3D view's own page is there; until then the map from above is shown. */
export const isLoaded = signal(false);

export const look = computed((): Look => {
  if (!canDraw) return "top";
  return chosen.value === "follow" && !hasVehicle.value ? "3d" : chosen.value;
});
/** Whether the map from above stands in the place of the 3D view. */
export const fromAbove = computed(() => look.value === "top" || !isLoaded.value);

export const OFFERED: readonly { key: Look; name: string; letter: string; enabled: () => boolean; run: () => void }[] = [
  { key: "3d", name: "3D", letter: "v", enabled: () => canDraw, run: () => (chosen.value = "3d") },
  { key: "follow", name: "Follow", letter: "f", enabled: () => canDraw && hasVehicle.value, run: () => (chosen.value = "follow") },
  { key: "top", name: "Top", letter: "t", enabled: () => true, run: () => (chosen.value = "top") },
];

export const LOOK_COMMANDS: readonly PageCommand[] = OFFERED.map(({ name, letter, enabled, run }) => ({
  name: `View: ${name}`,
  keys: [letter],
  enabled,
  run,
}));

const follows = computed(() => look.value === "follow");
let told = false;
/** Once it has followed: a station that is found again may still do what it was told before. */
let everFollowed = false;

effect(() => {
  if (!connected.value) {
    told = everFollowed;
    return;
  }
  if (follows.value || told) void submit({ type: "follow", view: VIEW, following: follows.value });
  told = follows.value;
  everFollowed ||= follows.value;
});
