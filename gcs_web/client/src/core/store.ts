/** Everything the page shows. */

import { computed, signal } from "@preact/signals";
import { initials } from "./format";
import { PROTOCOL } from "./protocol";
import { newest, on } from "./receive";
import type { Document, Draft, EffectFile, MapShown, Notice, Plan, Show, Vehicle, Waypoint, Welcome } from "./protocol";

// --- as the server sent it ---

export const welcome = signal<Welcome | null>(null);
/** What the pilots edit together; `document` is the browser's. */
export const doc = signal<Document | null>(null);
export const plan = signal<Plan | null>(null);
/** While a waypoint is dragged: what is foreseen, which nothing has checked. */
export const draft = signal<Draft | null>(null);
/** The plan with its figures; while another one is planned, or after it became void, the one before. */
export const figures = signal<Plan | null>(null);
/** Of the plan that was checked last. */
const preflightTold = newest("preflight", {
  type: "preflight",
  state: "none",
  stale: "",
  verdict: "not_shown",
  sentence: "",
  decides: "",
  remedy: "",
  flights: 0,
  wind_m_s: 0,
  assumed: [],
  asked: {},
  paths: [],
});
/** Height of the world in 3D views at the points looked at, by the views' names. */
export const viewScales = newest("view_scales", { type: "view_scales", heights_m: {} });
export const vehicle = signal<Vehicle | null>(null);
export const invitationEnded = newest("invitation_ended", { type: "invitation_ended", number: 0 });
export const people = newest("people", { type: "people", people: [], in_control: "" });
export const files = newest("files", { type: "files", trajectories: [], flights: [], bin: [], has_map: true, has_vehicle: true });
/** Those in the folder that this one is in. */
export const projects = newest("projects", { type: "projects", projects: [] });
export const mapShown = signal<MapShown | null>(null);
/** The map from above, at one height. */
export const section = newest("map_section", { type: "map_section", image: "", low_m: [0, 0], high_m: [0, 0], at_m: 0, of: null });
export const measured = newest("measured", {
  type: "measured",
  active: false,
  points_m: [],
  clearances_m: [],
  distance_m: null,
});
/** What an edit of the map would change; a shape of null: nobody draws one. */
export const mapPreview = newest("map_preview", {
  type: "map_preview",
  author: "",
  edit: null,
  shape: null,
  closed_m3: 0,
  opened_m3: 0,
  voxels: 0,
  drawn: false,
});
export const jobs = newest("jobs", { type: "jobs", jobs: [], kinds: [] });
/** Recorded flights; null until the server has listed them. */
export const flights = newest("flights", null);
/** The flights that stand in the 3D view, of whoever asked last. */
export const flightsShown = newest("flights_shown", {
  type: "flights_shown",
  author: "",
  flights: [],
  arrows: null,
  colour_reach: null,
  plan_too: false,
});
export const comparison = newest("comparison", null);
export const diagnosis = newest("diagnosis", null);
export const identification = newest("identification", null);
export const nextFlight = newest("next_flight", null);
export const model = newest("model", null);
/** Effect files of the user's own that the vehicle file names. */
export const effectFiles = signal<readonly EffectFile[]>([]);
export const notice = newest("notice", { type: "notice", text: "", level: "fact", undo: false });

/** Tracking errors as they were heard, of the last minute. */
export const errors = signal<readonly { heardAt_ms: number; error_m: number }[]>([]);
const ERRORS_KEPT_MS = 60_000;

/** What was flown of the trajectory that is under way, or of the last one, by the time along it. */
export interface Flown {
  along_s: number;
  speed_m_s: number;
  height_m: number;
  x_m: number;
  y_m: number;
}
export const flown = signal<readonly Flown[]>([]);

// --- of this page ---

/** `outdated`: the server speaks a newer protocol than this page. */
export const connection = signal<"connecting" | "open" | "closed" | "outdated">("connecting");
/** When the page tries to connect again, on the clock of `now_ms`. */
export const retryAt_ms = signal(0);
/** A clock for ages and countdowns; ticks four times a second. */
export const now_ms = signal(performance.now());
const vehicleHeardAt_ms = signal(0);

/** The moment of the plan that plots, table and 3D view show. */
export const cursor_s = signal<number | null>(null);
/** The moment of the recorded flights that plots and 3D view show, on their shifted time. */
export const flightCursor_s = signal<number | null>(null);
/** Ids of waypoints. */
export const selected = signal<ReadonlySet<number>>(new Set());
export const view = signal<Required<Pick<Show, "colour" | "flights">>>({ colour: "clearance", flights: true });
export const step = signal(2);
export const aborting = signal(false);
export const paletteOpen = signal(false);
export const projectsOpen = signal(false);
export const devicesOpen = signal(false);

/** Waypoints another person changed within the last second, with that person's initials. */
export const touched = signal<ReadonlyMap<number, string>>(new Map());
const TOUCHED_MS = 1000;

/** Two moments that differ by less are one; a click sets the cursor exactly, sums of times do not. */
const SAME_TIME_S = 1e-6;

// --- derived ---

export const connected = computed(() => connection.value === "open");

/** The verdict that may be shown: never "checked" while a waypoint is dragged, for another revision or without a
 * connection. */
export const verdict = computed<Plan["state"] | "draft" | "unknown">(() => {
  if (!connected.value) return "unknown";
  if (draft.value !== null) return "draft";
  const current = plan.value;
  if (current === null) return "none";
  const isOld = current.revision !== doc.value?.revision;
  return isOld && current.state === "checked" ? "planning" : current.state;
});

/** Whether the figures shown are those of an earlier plan. */
export const figuresAreOld = computed(
  () => figures.value !== plan.value || plan.value?.state === "void" || draft.value !== null || !connected.value,
);
export const series = computed(() => figures.value?.series ?? null);

/** The preflight of the checked plan, or of one before it; null while there is no checked plan. */
export const preflight = computed(() => (verdict.value === "checked" ? preflightTold.value : null));

/** Whether its own preflight forbids that the plan is flown. */
export const isNoGo = computed(() => preflight.value?.state === "current" && preflight.value.verdict === "no_go");

const me = computed(() => people.value.people.find((person) => person.id === welcome.value?.you) ?? null);
export const inControl = computed(
  () => people.value.in_control !== "" && people.value.in_control === welcome.value?.you,
);

/** Whether this page's flights stand in the 3D view, not another person's. */
export const areOurs = computed(() => flightsShown.value.author === welcome.value?.you);
/** Who has flights in the 3D view; empty for this page, and for nobody. */
export const othersFlights = computed(() =>
  areOurs.value ? "" : (people.value.people.find(({ id }) => id === flightsShown.value.author)?.name ?? ""),
);

/** Who gives the orders; empty for nobody. */
export const controlWords = computed(() => {
  if (inControl.value) return "You are in control";
  const holder = people.value.people.find(({ id }) => id === people.value.in_control);
  return holder === undefined ? "" : `${holder.name} is in control`;
});

/** Whether a vehicle is connected, heard or not. */
export const hasVehicle = computed(() => vehicle.value !== null && vehicle.value.link !== "none");

export const isArmed = computed(() => hasVehicle.value && vehicle.value?.armed === true);

/** Of a vehicle of other firmware; null for one that our controller flies. */
export const foreign = computed(() => vehicle.value?.foreign ?? null);

/** Whether it is one that is heard only in flight: its state is as old as the last look at it. */
export const isOnlyLookedAt = computed(() => foreign.value !== null && vehicle.value?.armed === false);

/** Whether the vehicle holds another trajectory than the plan. */
export const holdsAnother = computed(() => {
  const held = vehicle.value?.holds_crc32 ?? "";
  return held !== "" && held !== (plan.value?.crc32 ?? "");
});

const SILENCE_MS = 1500; // the server speaks of the vehicle at least twice a second
const LOST_MS = 3000;

/** The link as far as this page can know: the server's word, grown old by its silence, and whether that is heard. */
export const link = computed<{ state: Vehicle["link"]; age_s: number; stationHeard: boolean }>(() => {
  const last = vehicle.value;
  if (last === null) return { state: "none", age_s: 0, stationHeard: connected.value };
  const silence_ms = Math.max(0, now_ms.value - vehicleHeardAt_ms.value);
  const age_s = last.age_s + silence_ms / 1000;
  const stationHeard = connected.value && silence_ms <= SILENCE_MS;
  if (last.link === "none") return { state: "none", age_s, stationHeard };
  if (!connected.value || silence_ms > LOST_MS) return { state: "lost", age_s, stationHeard };
  if (last.link === "fresh" && !stationHeard) return { state: "stale", age_s, stationHeard };
  return { state: last.link, age_s, stationHeard };
});

/** The waypoint passed last at the cursor. */
export const waypointAtCursor = computed(() => {
  const time_s = cursor_s.value;
  if (time_s === null) return null;
  return figures.value?.passings.findLast((passing) => passing.time_s <= time_s + SAME_TIME_S)?.waypoint ?? null;
});

/** Index of the segment at the cursor; -1 for none. */
export const segmentAtCursor = computed(() => {
  const time_s = cursor_s.value;
  if (time_s === null) return -1;
  return figures.value?.segments.findLastIndex((segment) => segment.start_s <= time_s + SAME_TIME_S) ?? -1;
});

// --- messages ---

on("welcome", (message) => {
  // Another project was opened in the place of this one: nothing that is shown holds any more.
  if (welcome.value !== null && welcome.value.station !== message.station) location.reload();
  welcome.value = message;
  connection.value = message.protocol === PROTOCOL ? "open" : "outdated";
});
on("document", receiveDocument);
on("plan", receivePlan);
on("draft", (message) => (draft.value = message.waypoint === null ? null : message));
on("vehicle", receiveVehicle);
on("effect_files", (message) => (effectFiles.value = message.files));
on("flight_moment", (message) => (flightCursor_s.value = message.time_s));
on("cursor", (message) => (cursor_s.value = message.time_s));
on("shown", ({ author, colour, flights: withFlights }) => {
  // What this person chose may have changed again since it was sent.
  if (author !== welcome.value?.you) view.value = { colour, flights: withFlights };
});
on("map_shown", (message) => {
  if (mapShown.value === null || message.author !== welcome.value?.you) mapShown.value = message;
  else mapShown.value = { ...message, slice: mapShown.value.slice, layers: mapShown.value.layers };
});
on("selection", (message) => (selected.value = new Set(message.waypoints)));

function receiveVehicle(next: Vehicle): void {
  const heardAt_ms = performance.now();
  now_ms.value = heardAt_ms;
  vehicleHeardAt_ms.value = heardAt_ms;
  vehicle.value = next;
  noteFlown(next);
  if (next.error_m === null || next.link !== "fresh") return;
  const recent = errors.value.filter((each) => heardAt_ms - each.heardAt_ms < ERRORS_KEPT_MS);
  errors.value = [...recent, { heardAt_ms, error_m: next.error_m }];
}

function noteFlown({ along_s, speed_m_s, x_m, y_m, z_m, link: heard }: Vehicle): void {
  if (along_s === null || speed_m_s === null || x_m === null || y_m === null || z_m === null || heard !== "fresh") return;
  const last_s = flown.value.at(-1)?.along_s ?? -1;
  if (along_s === last_s) return;
  const before = along_s > last_s ? flown.value : []; // a new flight
  flown.value = [...before, { along_s, speed_m_s, height_m: z_m, x_m, y_m }];
}

/** Whether the trajectory of the plan is flown now. */
export const isFlown = computed(
  () => vehicle.value !== null && vehicle.value.along_s !== null && link.value.state === "fresh" && !holdsAnother.value,
);

function receivePlan(next: Plan): void {
  plan.value = next;
  const isBetween = next.series === null && (next.state === "planning" || next.state === "void");
  if (isBetween) return;
  figures.value = next;
  if (next.series !== null) cursor_s.value = Math.min(cursor_s.value ?? 0, next.duration_s);
}

function receiveDocument(next: Document): void {
  const before = doc.value;
  doc.value = next;
  const present = new Set(next.waypoints.map((waypoint) => waypoint.id));
  if ([...selected.value].some((id) => !present.has(id))) {
    selected.value = new Set([...selected.value].filter((id) => present.has(id)));
  }
  if (before === null || next.revision === before.revision || next.author === me.value?.name) return;
  const old = new Map(before.waypoints.map((waypoint) => [waypoint.id, waypoint]));
  const changed = next.waypoints.filter((waypoint) => !sameWaypoint(waypoint, old.get(waypoint.id)));
  if (changed.length === 0) return;
  const marks = new Map(changed.map((waypoint) => [waypoint.id, initials(next.author)]));
  touched.value = marks;
  setTimeout(() => {
    if (touched.value === marks) touched.value = new Map();
  }, TOUCHED_MS);
}

function sameWaypoint(a: Waypoint, b: Waypoint | undefined): boolean {
  return JSON.stringify(a) === JSON.stringify(b);
}

/** Say something of the page's own in the place of the server's notices. */
export function announce(text: string, level: Notice["level"] = "fact"): void {
  notice.value = { type: "notice", text, level, undo: false };
}
