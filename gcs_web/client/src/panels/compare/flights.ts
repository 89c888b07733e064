/** The recorded flights that this page looks at: which are open, their streams over the shown stretch, the cursor. */

import { batch, computed, effect, signal } from "@preact/signals";
import { latest, send, submit } from "../../core/socket";
import { sendFile } from "../../core/files";
import { number } from "../../core/format";
import { announce, areOurs, comparison, connected, flightCursor_s, flights, step } from "../../core/store";
import type { AlignFlights, Finding, FlightCard, Incoming, OpenedFlight, Scatter, ShowFlights, Stream, StreamPart } from "../../core/protocol";

export type Channel = NonNullable<ShowFlights["colour"]>;
export type AlignBy = AlignFlights["by"];

/** Names of the open flights, the first is A. */
export const open = signal<readonly string[]>([]);
export const opened = signal<readonly OpenedFlight[]>([]);
/** Keys of the streams that are drawn, from above. */
export const streamKeys = signal<readonly string[]>(["speed", "error", "F_x", "residual_F_x"]);
/** The shown stretch of shifted time; null for all of it. */
export const stretch = signal<readonly [number, number] | null>(null);
/** What each flight's clock is moved by hand or by alignment, s. */
export const moved_s = signal<ReadonlyMap<string, number>>(new Map());
/** By flight and stream: what was read last. */
export const parts = signal<ReadonlyMap<string, StreamPart>>(new Map());
/** The residual against a variable that is looked at. */
export const chosen = signal<{ channel: string; variable: string } | null>(null);
export const scatter = signal<Scatter | null>(null);
/** A bin of the scatter: its moments are shaded in the plots. */
export const bin = signal<readonly [number, number] | null>(null);
export const pathColour = signal<Channel>("");
/** Whether vehicles have arrows of residual force and torque. */
export const withArrows = signal(true);
/** Whether the first flight's vehicle is drawn as the model predicts it, too, and from how long before. */
export const withPredicted = signal(true);
export const FIRST_HORIZON_S = 0.5;
export const horizon_s = signal(FIRST_HORIZON_S);
/** A foreign log that waits for its column map. */
export const incoming = signal<Incoming | null>(null);
export const playing = signal(false);

/** Width of the plots in pixels: so many points are asked for. */
export const plotWidth_px = signal(800);

export const cards = computed<readonly FlightCard[]>(() => flights.value?.flights ?? []);
export const LETTERS = "ABCDEFGH";
export const MOST_OPEN = 4;

/** Flights that learn or judge and have gaps in their logs. */
export const gapped = computed<readonly string[]>(() =>
  cards.value
    .filter(({ role, findings }) => role !== "leave" && findings.some(({ what }) => what === "gap"))
    .map(({ name }) => name),
);
/** Whether the pieces between gaps are taken as flights of their own; a log with gaps is refused otherwise. */
export const splitGaps = signal(true);

/** From the first beginning to the last end of what is open. */
export const whole = computed<readonly [number, number]>(() => {
  const each = opened.value;
  if (each.length === 0) return [0, 1];
  const by = (name: string): number => moved_s.value.get(name) ?? 0;
  return [
    Math.min(...each.map(({ name, start_s }) => start_s + by(name))),
    Math.max(...each.map(({ name, end_s }) => end_s + by(name))),
  ];
});

export const shown = computed<readonly [number, number]>(() => stretch.value ?? whole.value);

/** All streams of the open flights, each once. */
export const offered = computed<readonly Stream[]>(() => {
  const found = new Map<string, Stream>();
  for (const flight of opened.value) for (const stream of flight.streams) found.set(stream.key, stream);
  return [...found.values()];
});

export const drawn = computed<readonly Stream[]>(() =>
  streamKeys.value.flatMap((key) => offered.value.find((stream) => stream.key === key) ?? []),
);

export const partKey = (flight: string, stream: string): string => `${flight}\n${stream}`;

export function toggleOpen(name: string, alone: boolean): void {
  const others = open.value.filter((each) => each !== name);
  if (alone) open.value = [name];
  else if (others.length < open.value.length) open.value = others;
  else open.value = [...others.slice(-(MOST_OPEN - 1)), name];
  stretch.value = null;
}

/** Move the flights beside the first by an event or by correlation; one of which nobody can tell stays. */
export async function align(by: AlignBy): Promise<void> {
  const names = [...open.value];
  const reply = await send({ type: "align_flights", flights: names, by });
  if (reply.error !== "") {
    announce(reply.error, "danger");
    return;
  }
  if (names.join("\n") !== open.value.join("\n")) return;
  const next = new Map(moved_s.value);
  const base_s = next.get(names[0] ?? "") ?? 0;
  const said = reply.aligned.map(({ flight, by_s, words }) => {
    const letter = LETTERS[names.indexOf(flight)] ?? "";
    if (by_s === null) return `${letter} stays: ${words}`;
    next.set(flight, Number((base_s + by_s).toFixed(4)));
    return `${letter} moved by ${number(base_s + by_s, 3)} s: ${words}`;
  });
  moved_s.value = next;
  announce(`${said.join(". ")}.`, reply.aligned.some(({ by_s }) => by_s === null) ? "caution" : "fact");
}

/** Say what a flight is for. Taken at once, so that a comparison started next is of this choice. */
export async function setRole(flight: string, role: FlightCard["role"]): Promise<void> {
  if (flights.value !== null) {
    const changed = cards.value.map((card) => (card.name === flight ? { ...card, role } : card));
    flights.value = { ...flights.value, flights: changed };
  }
  if (!(await submit({ type: "set_role", flight, role }))) await submit({ type: "list_flights" });
}

const FORMULA = "formula:";
/** Those of `streamKeys` that people wrote. */
const formulas = computed(() => streamKeys.value.filter((key) => key.startsWith(FORMULA)));

/** Draw a formula of the log's columns; why not, where it cannot be. */
export async function addFormula(text: string): Promise<string> {
  const key = `${FORMULA}${text.trim().replaceAll("|", "")}`;
  const flights = open.value.slice(0, 1);
  if (flights.length === 0) return "Open a flight first.";
  const reply = await send({ type: "open_flights", flights, formulas: [key] });
  const error = reply.error !== "" ? reply.error : (reply.flights[0]?.left_out[0] ?? "");
  if (error === "" && !streamKeys.value.includes(key)) streamKeys.value = [...streamKeys.value, key];
  return error;
}

export async function setNote(flight: string, note: string): Promise<void> {
  await submit({ type: "set_note", flight, note });
}

/** New names that are on their way: the list has them before the answer comes, and an open flight stays open. */
const renamed = new Map<string, string>();

export async function renameFlight(flight: string, name: string): Promise<void> {
  renamed.set(flight, name.trim());
  const { error } = await send({ type: "rename_flight", flight, name });
  renamed.delete(flight);
  if (error !== "") announce(error, "danger");
}

export function toggleStream(key: string): void {
  const keys = streamKeys.value;
  streamKeys.value = keys.includes(key) ? keys.filter((each) => each !== key) : [...keys, key];
}

const sendLook = latest((time_s: number | null) => ({ type: "look_at_flight", time_s }));

export function lookAt(time_s: number): void {
  const [from_s, to_s] = whole.value;
  flightCursor_s.value = Math.min(Math.max(time_s, from_s), to_s);
  sendLook(flightCursor_s.value);
}

export function goTo(time_s: number): void {
  playing.value = false;
  lookAt(time_s);
}

export function togglePlaying(): void {
  if (opened.value.length === 0) return;
  if (!playing.value && (flightCursor_s.value ?? 0) >= whole.value[1] - 1e-3) lookAt(Math.max(0, whole.value[0]));
  playing.value = !playing.value;
}

effect(() => {
  if (!playing.value) return undefined;
  let last_ms: number | null = null;
  let request = requestAnimationFrame(function frame(time_ms: number) {
    if (last_ms !== null) lookAt((flightCursor_s.peek() ?? 0) + (time_ms - last_ms) / 1000);
    last_ms = time_ms;
    if ((flightCursor_s.peek() ?? 0) >= whole.peek()[1]) playing.value = false;
    else request = requestAnimationFrame(frame);
  });
  return () => cancelAnimationFrame(request);
});

// --- what the server is asked ---

const isLooking = computed(() => connected.value && step.value === 4);

/** Open the newest flight when there is nothing else to look at; forget those that are gone. */
effect(() => {
  if (flights.value === null) return;
  const ready = cards.value.filter(({ state }) => state === "ready").map(({ name }) => name);
  const known = open.peek().map((name) => renamed.get(name) ?? name);
  const there = known.filter((name) => cards.value.some((card) => card.name === name));
  const first = ready.slice(0, 1);
  const next = there.length > 0 ? there : first;
  if (next.join("\n") !== open.peek().join("\n")) open.value = next;
});

/** Read again what streams there are whenever the open flights or the comparison are others. */
effect(() => {
  const names = [...open.value];
  const isNew = comparison.value?.state; // a comparison adds streams
  if (!connected.value || isNew === undefined) return;
  const own = [...formulas.value];
  void send({ type: "open_flights", flights: names, formulas: own }).then((reply) => {
    if (reply.error !== "") announce(reply.error, "danger");
    else if (names.join("\n") === open.peek().join("\n")) {
      batch(() => {
        opened.value = reply.flights;
        parts.value = new Map();
        flightCursor_s.value ??= Math.max(0, reply.flights[0]?.start_s ?? 0);
      });
    }
  });
});

type Drawn = Pick<ShowFlights, "flights" | "colour" | "moved_s" | "arrows" | "predicted_s">;
const showIn3D = latest(
  (wanted: Drawn) => ({ type: "show_flights", ...wanted }),
  ({ error }) => {
    if (error !== "") announce(error, "danger");
  },
);
let isShown = false;
let asked: Drawn = { flights: [] };

/** Put this page's flights into the 3D view again, in place of another person's. */
export function showOurs(): void {
  showIn3D(asked);
}

effect(() => {
  const names = isLooking.value ? opened.value.map(({ name }) => name) : [];
  const colour = pathColour.value;
  const moved = Object.fromEntries(moved_s.value);
  const arrows = withArrows.value;
  const offered = comparison.value?.horizons_s ?? [];
  const predicted_s = withPredicted.value && offered.includes(horizon_s.value) ? horizon_s.value : null;
  if (!connected.value) isShown = false;
  if (!connected.value || (names.length === 0 && !isShown)) return;
  const before = isShown ? JSON.stringify(asked) : "";
  isShown = names.length > 0;
  asked = { flights: names, colour, moved_s: moved, arrows, predicted_s };
  // What was only read anew, as after a comparison, does not take the place of what another person opened since.
  if (JSON.stringify(asked) === before && !areOurs.peek()) return;
  showIn3D(asked);
  if (isShown) sendLook(flightCursor_s.peek());
});

/** Flights that come back, when another person looks elsewhere, stand at the moment they were left at. */
effect(() => {
  if (areOurs.value) sendLook(flightCursor_s.peek());
});

let reading = false;
let again = false;

/** One question at a time: of those that come while one is on its way the last one is asked. */
async function readStreams(): Promise<void> {
  if (reading) {
    again = true;
    return;
  }
  reading = true;
  do {
    again = false;
    const [from_s, to_s] = shown.peek();
    const margin_s = 0.5 * (to_s - from_s);
    for (const flight of opened.peek()) {
      const by_s = moved_s.peek().get(flight.name) ?? 0;
      const there = new Set(flight.streams.map(({ key }) => key));
      const keys = streamKeys.peek().filter((key) => there.has(key));
      if (keys.length === 0) continue;
      const reply = await send({
        type: "read_streams",
        flight: flight.name,
        streams: keys,
        from_s: from_s - by_s - margin_s,
        to_s: to_s - by_s + margin_s,
        points: 2 * Math.round(plotWidth_px.peek()),
      });
      if (reply.error === "") {
        const next = new Map(parts.peek());
        for (const part of reply.parts) next.set(partKey(part.flight, part.key), part);
        parts.value = next;
      }
    }
  } while (again);
  reading = false;
}

effect(() => {
  const wanted = [opened.value, streamKeys.value, shown.value, plotWidth_px.value, moved_s.value];
  if (isLooking.value && wanted.length > 0) void readStreams();
});

let lookedAt = "";

effect(() => {
  const wanted = chosen.value;
  const state = comparison.value?.state;
  const cell = wanted === null ? "" : `${wanted.channel}|${wanted.variable}`;
  if (lookedAt !== "" && cell !== lookedAt) bin.value = null;
  if (cell !== "") lookedAt = cell;
  if (!connected.value || wanted === null || state === undefined || state === "none") {
    scatter.value = null;
    return;
  }
  void send({ type: "read_scatter", ...wanted }).then((reply) => {
    if (wanted === chosen.peek()) scatter.value = reply.scatter;
  });
});

/** The cell with the highest share is looked at first. */
effect(() => {
  const found = comparison.value;
  if (found === null || found.state === "none") return;
  const now = chosen.peek();
  if (now !== null && found.variables.some(({ name }) => name === now.variable)) {
    chosen.value = { ...now };
    return;
  }
  let best: { channel: string; variable: string } | null = null;
  let most = 0;
  for (const row of found.channels) {
    row.shares.forEach((share, i) => {
      const variable = found.variables[i];
      if (variable !== undefined && variable.name !== "constant" && share > most) {
        most = share;
        best = { channel: row.channel, variable: variable.name };
      }
    });
  }
  chosen.value = best;
});

/** Stretches of a flight's time whose points lie in the chosen bin. */
export const moments = computed<readonly { flight: string; from_s: number; to_s: number }[]>(() => {
  const found = scatter.value;
  const range = bin.value;
  if (found === null || range === null) return [];
  const spans: { flight: string; from_s: number; to_s: number }[] = [];
  found.x.forEach((x, i) => {
    if (x < range[0] || x > range[1]) return;
    const flight = found.flights[found.flight[i] ?? 0] ?? "";
    const middle_s = found.time_s[i] ?? 0;
    const from_s = middle_s - found.span_s / 2;
    const last = spans.at(-1);
    if (last?.flight === flight && from_s <= last.to_s + found.span_s / 2) last.to_s = middle_s + found.span_s / 2;
    else spans.push({ flight, from_s, to_s: middle_s + found.span_s / 2 });
  });
  return spans;
});

const markIn3D = latest((stretches: { flight: string; from_s: number; to_s: number }[]) => ({
  type: "show_moments",
  stretches,
}));
let isMarked = false;

/** The same moments on the paths. */
effect(() => {
  const wanted = isLooking.value && areOurs.value ? [...moments.value] : [];
  if (!connected.value || (wanted.length === 0 && !isMarked)) return;
  isMarked = wanted.length > 0;
  markIn3D(wanted);
});
/** A stretch of a flight where a check found something, at the time it is shown at. */
export interface Mark {
  flight: string;
  finding: Finding;
  from_s: number;
  to_s: number;
}

/** The one that was clicked last: its words and its fix stand below the strip. */
export const chosenMark = signal<Mark | null>(null);

export const marks = computed<readonly Mark[]>(() =>
  opened.value.flatMap(({ name, shift_s }) => {
    const by_s = (moved_s.value.get(name) ?? 0) - shift_s;
    const findings = cards.value.find((card) => card.name === name)?.findings ?? [];
    return findings.flatMap((finding) =>
      finding.spans_s.map(([from_s, to_s]) => ({ flight: name, finding, from_s: from_s + by_s, to_s: to_s + by_s })),
    );
  }),
);

/** Show a mark in the middle of a stretch of which it takes a quarter, at least a second long. */
export function goToMark({ from_s, to_s }: Mark): void {
  const [first_s, last_s] = whole.value;
  const half_s = Math.max(2 * (to_s - from_s), 0.5);
  const middle_s = 0.5 * (from_s + to_s);
  goTo(middle_s);
  stretch.value = [Math.max(first_s, middle_s - half_s), Math.min(last_s, middle_s + half_s)];
}

// --- logs ---

/** Send a dropped file to the station and have it read. */
/** The newest flight before this one of the same trajectory. */
export function lastOfCourse(name: string): FlightCard | undefined {
  const course = cards.value.find((card) => card.name === name)?.trajectory ?? "";
  const older = cards.value.slice(cards.value.findIndex((card) => card.name === name) + 1);
  return course === "" ? undefined : older.find((card) => card.trajectory === course && card.state === "ready");
}

/** Open a flight in Compare, beside the last one before it of the same trajectory. */
export function compareWithLast(name: string): void {
  const last = lastOfCourse(name);
  open.value = last === undefined ? [name] : [name, last.name];
  step.value = 4;
}

/** Endings of logs that can be read. */
export const LOGS = [
  ".parquet", ".ulg", ".bin", ".log", ".bbl", ".bfl", ".tlog", ".tum", ".csv", ".csv.gz", ".mcap", ".bag", ".db3",
];

export async function takeFile(file: File): Promise<void> {
  const error = await sendFile(file);
  if (error !== "") announce(error, "danger");
  else await takeLog(file.name, "");
}

export async function takeLog(file: string, column_map: string): Promise<string> {
  announce(`Reading ${file} ...`);
  const reply = await send({ type: "take_log", file, column_map });
  if (reply.error !== "") {
    announce(reply.error, "danger");
    return reply.error;
  }
  incoming.value = reply.incoming;
  if (reply.incoming !== null) announce(`${file} does not say what its columns are: check the guesses.`, "caution");
  if (reply.name !== "") open.value = [reply.name];
  return "";
}

/** Apply what the checks propose to a new log: all of it, or what the finding with one sentence does. */
export async function fixFlight(flight: string, only = ""): Promise<void> {
  const reply = await send({ type: "fix_flight", flight, only });
  if (reply.error !== "") return announce(reply.error, "danger");
  if (only !== "") open.value = open.value.map((name) => (name === flight ? reply.name : name));
  undo.value = { words: `${reply.name} was made`, act: () => discardFlight(reply.name) };
}

export async function discardFlight(flight: string): Promise<void> {
  const reply = await send({ type: "discard_flight", flight });
  if (reply.error !== "") announce(reply.error, "danger");
  else undo.value = { words: `${flight} was discarded`, act: () => restoreFlight(reply.name) };
}

async function restoreFlight(kept: string): Promise<void> {
  undo.value = null;
  await submit({ type: "restore_flight", kept });
}

/** What this page did to the logs last, and the way back. */
export const undo = signal<{ words: string; act: () => Promise<void> } | null>(null);
