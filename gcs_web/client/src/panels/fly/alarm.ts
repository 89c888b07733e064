/** What a pilot must notice without looking: said, sounded and felt while the vehicle is armed. */

import { computed, effect, signal } from "@preact/signals";
import { number } from "../../core/format";
import type { LostLinkAct, Vehicle } from "../../core/protocol";
import { remembered } from "../../core/remembered";
import { isArmed, link, vehicle } from "../../core/store";

export interface Alarm {
  key: string;
  level: "caution" | "danger";
  words: string;
}

const isFlag = (value: unknown): value is boolean => typeof value === "boolean";

/** Whether alarms are silent in this browser; what is said of them stays. */
export const muted = remembered("muted", false, isFlag);

const LITTLE_LEFT_S = 60;

const linkAlarm = computed((): Alarm | null => {
  const { state, age_s, stationHeard } = link.value;
  if (!stationHeard) return stationAlarm(state);
  const acts = vehicle.value?.if_link_lost ?? [];
  if (state === "lost") return { key: "link", level: "danger", words: lostWords(acts, age_s) };
  return state === "stale" ? { key: "stale", level: "caution", words: staleWords(acts, age_s) } : null;
});

/** The worst first. */
export const alarms = computed((): readonly Alarm[] => {
  const last = vehicle.value;
  if (last === null || !isArmed.value) return [];
  const found: Alarm[] = [];
  if (last.mission === "fault") found.push({ key: "fault", level: "danger", words: `Fault: ${last.reason || "see the log"}.` });
  if (linkAlarm.value !== null) found.push(linkAlarm.value);
  const { error_m, room_m, battery_left_s } = last;
  if (error_m !== null && room_m !== null && error_m > room_m)
    found.push({ key: "room", level: "danger", words: `Off the path by ${number(1000 * error_m, 0)} mm: room is ${number(1000 * room_m, 0)} mm.` });
  if (battery_left_s !== null && battery_left_s < LITTLE_LEFT_S)
    found.push({ key: "battery", level: "caution", words: `Battery: ${number(battery_left_s, 0)} s left. Land.` });
  return found.sort((a, b) => Number(b.level === "danger") - Number(a.level === "danger"));
});

/** This page and the station do not hear each other; the vehicle may well be heard there. */
function stationAlarm(state: Vehicle["link"]): Alarm {
  if (state !== "lost") return { key: "quiet", level: "caution", words: "This page hears nothing of the station." };
  return { key: "station", level: "danger", words: "This page lost the station: what the vehicle does is not known here." };
}

/** What the vehicle does by itself now and next, by the silence so far. */
export function lostWords(acts: readonly LostLinkAct[], age_s: number): string {
  if (acts.length === 0) return "Link lost: what the vehicle does now is not known here. Use the RC transmitter.";
  const begun = acts.findLast(({ after_s }) => after_s <= age_s);
  const next = acts.find(({ after_s }) => after_s > age_s);
  const now = begun === undefined ? "the vehicle goes on" : `it ${begun.act}`;
  return `Link lost: ${now}${next === undefined ? "" : `; ${next.act} in about ${number(next.after_s - age_s, 0)} s`}.`;
}

/** Before it is lost: how long until the vehicle acts by itself, and how. */
function staleWords(acts: readonly LostLinkAct[], age_s: number): string {
  const next = acts.find(({ after_s }) => after_s > age_s);
  const silent = `Nothing heard for ${number(age_s, 1)} s`;
  return next === undefined ? `${silent}.` : `${silent}: in ${number(next.after_s - age_s, 1)} s it ${next.act}.`;
}

// --- sound and vibration ---

const AGAIN_MS = 1500;
const TONES: Readonly<Record<Alarm["level"], readonly number[]>> = { danger: [880, 660, 880], caution: [660] };
const TONE_S = 0.16;
const STARTS_MS = 500;
let audio: AudioContext | null = null;

/** Whether the browser keeps this page silent until somebody touches it, as after it was loaded anew in flight. */
export const blocked = signal(false);

function opened(): AudioContext {
  if (audio !== null) return audio;
  const made = new AudioContext();
  const look = (): void => void (blocked.value = made.state !== "running");
  made.onstatechange = () => {
    look();
    if (!blocked.value && worst.value !== null && !muted.value) play(made, worst.value); // what was not sounded
  };
  setTimeout(look, STARTS_MS);
  return (audio = made);
}

export function unblock(): void {
  void audio?.resume();
}

for (const kind of ["pointerup", "keydown"]) addEventListener(kind, unblock, { capture: true });

/** Nothing is queued while the page may not sound: all of it would sound at once later. */
function sound(level: Alarm["level"]): void {
  navigator.vibrate?.(level === "danger" ? [300, 100, 300] : [120]);
  const out = opened();
  if (out.state === "running") play(out, level);
  else void out.resume();
}

function play(out: AudioContext, level: Alarm["level"]): void {
  TONES[level].forEach((pitch_hz, at) => tone(out, pitch_hz, at * 1.4 * TONE_S));
}

function tone(context: AudioContext, pitch_hz: number, after_s: number): void {
  const source = context.createOscillator();
  const volume = context.createGain();
  const begin_s = context.currentTime + after_s;
  source.frequency.value = pitch_hz;
  source.type = "square";
  volume.gain.setValueAtTime(0.2, begin_s);
  volume.gain.setTargetAtTime(0, begin_s + 0.75 * TONE_S, 0.02);
  source.connect(volume).connect(context.destination);
  source.start(begin_s);
  source.stop(begin_s + 1.5 * TONE_S);
}

/** Which alarms there are; another one sounds at once, danger again and again. */
const kinds = computed(() => alarms.value.map(({ key }) => key).join());
const worst = computed(() => alarms.value[0]?.level ?? null);

effect(() => {
  if (isArmed.value && !muted.value) opened(); // so that it is known before the first alarm whether it will sound
});

effect(() => {
  const level = worst.value;
  if (kinds.value === "" || level === null || muted.value) return undefined;
  sound(level);
  if (level === "caution") return undefined;
  const again = setInterval(() => sound(level), AGAIN_MS);
  return () => clearInterval(again);
});

// --- the screen stays on in flight ---

const visible = signal(document.visibilityState === "visible");
document.addEventListener("visibilitychange", () => (visible.value = document.visibilityState === "visible"));

effect(() => {
  if (!isArmed.value || !visible.value || !("wakeLock" in navigator)) return undefined;
  const asked = navigator.wakeLock.request("screen").catch(() => null); // refused to save power: nothing to say
  return () => void asked.then((lock) => lock?.release());
});
