/** The same streams otherwise than over time: as spectra, one against another, and to take away. */

import { computed, effect, signal } from "@preact/signals";
import { send } from "../../core/socket";
import { announce, connected, step } from "../../core/store";
import type { CurvePart, Pairs, Spectrogram, Spectrum, Stream } from "../../core/protocol";
import { asPng, svgOf } from "../../plots/figure";
import type { Figure, FigureCurve } from "../../plots/figure";
import { LETTERS, drawn, moved_s, offered, opened, partKey, parts, shown, streamKeys } from "./flights";

export const KINDS = ["time", "spectrum", "spectrogram", "xy"] as const;
export type Kind = (typeof KINDS)[number];

export const kind = signal<Kind>("time");
/** Streams along x and y; empty: the first two that are drawn. */
export const along = signal<readonly [string, string]>(["", ""]);
const spectra = signal<ReadonlyMap<string, Spectrum>>(new Map());
const grams = signal<readonly Spectrogram[]>([]);
const pairs = signal<readonly Pairs[]>([]);
/** Why there is nothing to see. */
export const studyProblem = signal("");

export const nextKind = (): void => void (kind.value = KINDS[(KINDS.indexOf(kind.value) + 1) % KINDS.length] ?? "time");

/** Streams of the x-y plot, as long as the flights have them. */
export const xy = computed<readonly [Stream | undefined, Stream | undefined]>(() => {
  const [first, second] = drawn.value.length > 1 ? drawn.value : offered.value;
  const found = along.value.map((key) => offered.value.find((stream) => stream.key === key));
  return [found[0] ?? first, found[1] ?? second];
});

const COMPARE_STEP = 4;

effect(() => {
  const wanted = kind.value;
  if (!connected.value || step.value !== COMPARE_STEP || wanted === "time") return;
  const [from_s, to_s] = shown.value;
  const flights = opened.value.map(({ name, streams }) => {
    const by_s = moved_s.value.get(name) ?? 0;
    return { name, has: new Set(streams.map(({ key }) => key)), from_s: from_s - by_s, to_s: to_s - by_s };
  });
  if (wanted === "spectrum") void readSpectra(flights, streamKeys.value);
  else if (wanted === "spectrogram") void readSpectrograms(flights, streamKeys.value);
  else void readPairs(flights, xy.value);
});

interface Part {
  name: string;
  has: ReadonlySet<string>;
  from_s: number;
  to_s: number;
}

/** What was asked last: an answer to an older question is not shown. */
let asked = 0;

async function readSpectra(flights: readonly Part[], keys: readonly string[]): Promise<void> {
  asked += 1;
  const mine = asked;
  const found = new Map<string, Spectrum>();
  let problem = "";
  for (const { name, has, from_s, to_s } of flights) {
    for (const stream of keys.filter((key) => has.has(key))) {
      const reply = await send({ type: "read_spectrum", flight: name, stream, from_s, to_s });
      if (mine !== asked) return; // nor are the rest of its questions asked
      if (reply.spectrum !== null) found.set(partKey(name, stream), reply.spectrum);
      problem ||= reply.error;
    }
  }
  spectra.value = found;
  studyProblem.value = problem;
}

/** Of the first flight: pictures do not lie over each other. */
async function readSpectrograms(flights: readonly Part[], keys: readonly string[]): Promise<void> {
  asked += 1;
  const mine = asked;
  const found: Spectrogram[] = [];
  let problem = "";
  for (const { name, has, from_s, to_s } of flights.slice(0, 1)) {
    for (const stream of keys.filter((key) => has.has(key))) {
      const reply = await send({ type: "read_spectrogram", flight: name, stream, from_s, to_s });
      if (mine !== asked) return;
      if (reply.spectrogram !== null) found.push(reply.spectrogram);
      problem ||= reply.error;
    }
  }
  grams.value = found;
  studyProblem.value = problem;
}

async function readPairs(flights: readonly Part[], [x, y]: typeof xy.value): Promise<void> {
  asked += 1;
  const mine = asked;
  const found: Pairs[] = [];
  let problem = x === undefined || y === undefined ? "Choose two streams." : "";
  for (const { name, has, from_s, to_s } of flights) {
    if (x === undefined || y === undefined || !has.has(x.key) || !has.has(y.key)) continue;
    const reply = await send({ type: "read_pairs", flight: name, x: x.key, y: y.key, from_s, to_s });
    if (mine !== asked) return;
    if (reply.pairs !== null) found.push(reply.pairs);
    problem ||= reply.error;
  }
  pairs.value = found;
  studyProblem.value = problem;
}

// --- as figures ---

const COLOURS: Readonly<Record<CurvePart["kind"], string>> = { measured: "measured", plan: "planned", model: "model", residual: "residual" };
/** Of the flights in an x-y plot. */
const FLIGHTS = ["accent", "caution", "model", "residual"];
/** The last window of a stretch seldom ends with it. */
const WHOLE = 0.95;
const DASHES: readonly (readonly number[])[] = [[], [6, 3], [2, 3], [8, 3, 2, 3]];

const titled = (name: string, unit: string): string => (unit === "" ? name : `${name}, ${unit}`);

export function figureOf(wanted: Kind): Figure {
  if (wanted === "time") return overTime();
  if (wanted === "spectrogram") return asSpectrograms();
  return wanted === "spectrum" ? asSpectra() : oneAgainstAnother();
}

function looks(place: number, { label, kind: what }: Pick<CurvePart, "label" | "kind">): Pick<FigureCurve, "name" | "colour" | "dash"> {
  const letter = opened.value.length > 1 ? `${LETTERS[place] ?? ""} ` : "";
  return { name: `${letter}${label}`, colour: COLOURS[what], dash: DASHES[place] ?? [] };
}

function overTime(): Figure {
  const [from_s, to_s] = shown.value;
  const rows = drawn.value.map((stream) => ({
    title: titled(stream.name, stream.unit),
    curves: opened.value.flatMap(({ name }, place) => {
      const part = parts.value.get(partKey(name, stream.key));
      const by_s = moved_s.value.get(name) ?? 0;
      const inside = (part?.time_s ?? []).flatMap((at, i) => (at + by_s >= from_s && at + by_s <= to_s ? [i] : []));
      return (part?.curves ?? []).map((curve) => ({
        ...looks(place, curve),
        x: inside.map((i) => (part?.time_s[i] ?? 0) + by_s),
        y: inside.map((i) => curve.values[i] ?? null),
      }));
    }),
  }));
  return { rows, xTitle: "Time, s", xEnds: shown.value };
}

/** A name says how much of what was measured a curve stands for, where that is not all. */
function ofShare<T extends { name: string }>(curve: T, share: number): T {
  return share < WHOLE ? { ...curve, name: `${curve.name}, of ${Math.round(100 * share)} %` } : curve;
}

function asSpectra(): Figure {
  const rows = drawn.value.map((stream) => ({
    title: titled(stream.name, `${stream.unit === "" ? "1" : `(${stream.unit})²`}/Hz`),
    logX: true,
    logY: true,
    curves: opened.value.flatMap(({ name }, place) =>
      (spectra.value.get(partKey(name, stream.key))?.curves ?? []).map((curve) => ({
        ...ofShare(looks(place, curve), curve.share),
        x: curve.frequency_hz,
        y: curve.density,
      })),
    ),
  }));
  return { rows, xTitle: "Frequency, Hz" };
}

function asSpectrograms(): Figure {
  const by_s = moved_s.value.get(opened.value[0]?.name ?? "") ?? 0;
  const rows = grams.value.map(({ key, time_s, frequency_hz, power_db }) => {
    const stream = offered.value.find((each) => each.key === key);
    const unit = stream === undefined || stream.unit === "" ? "1" : `(${stream.unit})²`;
    return {
      title: `${stream?.name ?? key}: frequency, Hz`,
      curves: [],
      heat: { x: time_s.map((at) => at + by_s), y: frequency_hz, values: power_db, unit: `dB ${unit}/Hz` },
    };
  });
  return { rows, xTitle: "Time, s", xEnds: shown.value };
}

function oneAgainstAnother(): Figure {
  const [x, y] = xy.value;
  const curves = pairs.value.map(({ flight, x: xs, y: ys }) => {
    const place = Math.max(0, opened.value.findIndex(({ name }) => name === flight));
    return { name: flight, colour: FLIGHTS[place] ?? "measured", x: xs, y: ys, dots: true };
  });
  return { rows: [{ title: titled(y?.name ?? "", y?.unit ?? ""), curves }], xTitle: titled(x?.name ?? "", x?.unit ?? "") };
}

// --- to take away ---

const [WIDTH, ROW, FOOT] = [1200, 220, 34];
const NAMES: Readonly<Record<Kind, string>> = { time: "plots", spectrum: "spectrum", spectrogram: "spectrogram", xy: "x-y" };

export async function savePlot(as: "svg" | "png"): Promise<void> {
  const figure = figureOf(kind.value);
  const height = FOOT + figure.rows.length * (kind.value === "xy" ? 3 * ROW : ROW);
  const svg = svgOf(figure, WIDTH, height);
  const file = `${opened.value.map(({ name }) => name).join(" ")} ${NAMES[kind.value]}.${as}`;
  try {
    take(as === "svg" ? new Blob([svg], { type: "image/svg+xml" }) : await asPng(svg, WIDTH, height), file);
  } catch {
    announce("This browser cannot make the picture; save it as SVG.", "danger");
  }
}

function take(what: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(what);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Every sample of the streams that are shown, over the shown stretch; a file for each flight. */
export function saveData(as: "csv" | "parquet"): void {
  const [from_s, to_s] = shown.value;
  const seen = kind.value === "xy" ? xy.value.flatMap((stream) => stream ?? []) : drawn.value;
  for (const { name, streams } of opened.value) {
    const by_s = moved_s.value.get(name) ?? 0;
    const keys = seen.map(({ key }) => key).filter((key) => streams.some((stream) => stream.key === key));
    if (keys.length === 0) continue;
    const words = new URLSearchParams({ flight: name, streams: keys.join("|"), from: String(from_s - by_s), to: String(to_s - by_s), as });
    const link = document.createElement("a");
    link.href = `/data?${words.toString()}`;
    link.download = `${name}.${as}`;
    link.click();
  }
}
