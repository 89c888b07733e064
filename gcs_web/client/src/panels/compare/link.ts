/** The view in the page's address, so that a link restores it. */

import { effect } from "@preact/signals";
import { FIRST_HORIZON_S, bin, chosen, horizon_s, moved_s, open, pathColour, streamKeys, stretch, withArrows, withPredicted } from "./flights";
import type { Channel } from "./flights";
import { KINDS, along, kind } from "./studying";
import { announce, flightCursor_s, step } from "../../core/store";

const COLOURS: readonly Channel[] = ["", "F_x", "F_y", "F_z", "M_x", "M_y", "M_z"];

function restore(): void {
  const found = new URLSearchParams(location.hash.slice(1));
  const wanted = Number(found.get("step") ?? NaN);
  if (wanted >= 0 && wanted <= 5) step.value = Math.floor(wanted);
  const names = found.get("flights");
  if (names !== null && names !== "") open.value = names.split("|");
  kind.value = KINDS.find((each) => each === found.get("plot")) ?? "time";
  const [x, y] = (found.get("along") ?? "").split("|");
  if (x !== undefined && y !== undefined) along.value = [x, y];
  const keys = found.get("streams");
  if (keys !== null) streamKeys.value = keys.split("|").filter((key) => key !== "");
  const [from_s, to_s] = (found.get("from_to") ?? "").split("|").map(Number);
  if (from_s !== undefined && to_s !== undefined && from_s < to_s) stretch.value = [from_s, to_s];
  const time_s = found.get("time");
  if (time_s !== null && Number.isFinite(Number(time_s))) flightCursor_s.value = Number(time_s);
  const [channel, variable] = (found.get("cell") ?? "").split("|");
  if (channel !== undefined && channel !== "" && variable !== undefined) chosen.value = { channel, variable };
  const [low, high] = (found.get("bin") ?? "").split("|").map(Number);
  if (low !== undefined && high !== undefined && low <= high) bin.value = [low, high];
  const moved = (found.get("moved") ?? "").split("|").flatMap((by, i): [string, number][] => {
    const [name, by_s] = [open.value[i], Number(by)];
    return name !== undefined && Number.isFinite(by_s) && by_s !== 0 ? [[name, by_s]] : [];
  });
  if (moved.length > 0) moved_s.value = new Map(moved);
  const colour = COLOURS.find((each) => each === found.get("colour"));
  if (colour !== undefined) pathColour.value = colour;
  withArrows.value = found.get("arrows") !== "no";
  const predicted = found.get("predicted");
  withPredicted.value = predicted !== "no";
  if (Number(predicted) > 0) horizon_s.value = Number(predicted);
}

function written(): string {
  const words = new URLSearchParams({ step: String(step.value) });
  if (step.value >= 4) {
    words.set("flights", open.value.join("|"));
    words.set("streams", streamKeys.value.join("|"));
    if (kind.value !== "time") words.set("plot", kind.value);
    if (along.value.some((key) => key !== "")) words.set("along", along.value.join("|"));
    if (stretch.value !== null) words.set("from_to", stretch.value.map((time_s) => time_s.toFixed(3)).join("|"));
    if (flightCursor_s.value !== null) words.set("time", flightCursor_s.value.toFixed(3));
    if (chosen.value !== null) words.set("cell", `${chosen.value.channel}|${chosen.value.variable}`);
    if (bin.value !== null) words.set("bin", bin.value.join("|"));
    const moved = open.value.map((name) => moved_s.value.get(name) ?? 0);
    if (moved.some((by_s) => by_s !== 0)) words.set("moved", moved.join("|"));
    if (pathColour.value !== "") words.set("colour", pathColour.value);
    if (!withArrows.value) words.set("arrows", "no");
    if (!withPredicted.value) words.set("predicted", "no");
    else if (horizon_s.value !== FIRST_HORIZON_S) words.set("predicted", String(horizon_s.value));
  }
  return `#${words.toString()}`;
}

/** Restore the view that the address names, and keep the address up to date from then on. */
export function startLink(): void {
  if (location.hash !== "") restore();
  let timer = 0;
  effect(() => {
    const hash = written();
    clearTimeout(timer);
    timer = window.setTimeout(() => history.replaceState(null, "", hash), 300);
  });
}

export async function copyLink(): Promise<void> {
  const address = `${location.origin}${location.pathname}${written()}`;
  try {
    await navigator.clipboard.writeText(address);
    announce("Link to this view copied. It opens in browsers that have come in to this station.");
  } catch {
    announce(`Link to this view: ${address}`);
  }
}
