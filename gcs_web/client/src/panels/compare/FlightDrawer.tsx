/** The timeline of recorded flights: plots that share one axis of time and one cursor, read at the detail of the screen. */

import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { PlayButton } from "../../components/PlayButton";
import { editable, number, short } from "../../core/format";
import {
  LETTERS,
  align,
  drawn,
  goTo,
  marks,
  moments,
  moved_s,
  offered,
  open,
  opened,
  partKey,
  parts,
  playing,
  plotWidth_px,
  shown,
  stretch,
  streamKeys,
  togglePlaying,
  toggleStream,
  whole,
} from "./flights";
import type { AlignBy } from "./flights";
import { copyLink } from "./link";
import { FindingMarks, marksPx } from "./FindingMarks";
import { FORMULA, FormulaForm, writing } from "./Formula";
import { KindChoice, Study } from "./Studies";
import { kind } from "./studying";
import { plotHeight } from "../../plots/plots";
import { flightCursor_s } from "../../core/store";
import { isLight, phone, token } from "../../core/theme";
import type { CurvePart, Stream, StreamPart } from "../../core/protocol";

const MARGINS = { left: 184, right: 16 };
const PHONE_MARGINS = { left: 16, right: 16 };
const HEAD_PX = 40;
const AXIS_PX = 20;
const SMALLEST_ROW_PX = 56;
const PHONE_ROW_PX = 96;

export function FlightDrawer({ height }: { height?: number }) {
  const box = useRef<HTMLDivElement>(null);
  const width = useSignal(0);
  const margins = phone.value ? PHONE_MARGINS : MARGINS;
  useLayoutEffect(() => {
    const element = box.current;
    if (element === null) return undefined;
    const measure = (): void => {
      width.value = element.clientWidth;
      plotWidth_px.value = Math.max(100, element.clientWidth - margins.left - margins.right);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    measure();
    return () => observer.disconnect();
  }, [margins]);
  const rows = drawn.value;
  const isOverTime = kind.value === "time" && width.value > 0;
  const room = (height ?? 0) - HEAD_PX - AXIS_PX - marksPx.value;
  const row_px = phone.value ? PHONE_ROW_PX : Math.max(SMALLEST_ROW_PX, Math.floor(room / Math.max(1, rows.length)));
  return (
    <div class="drawer">
      <DrawerHead />
      <FormulaForm />
      <div class="plots" ref={box} role="group" aria-label="Plots" tabIndex={0} onKeyDown={byKey}>
        {opened.value.length === 0 && <p class="empty">Open a flight to see it over time.</p>}
        {opened.value.length > 0 && rows.length === 0 && kind.value !== "xy" && <p class="empty">Add a stream to see it.</p>}
        {(kind.value === "xy" || (kind.value !== "time" && rows.length > 0)) && width.value > 0 && <Study width={width.value} row_px={row_px} />}
        {isOverTime && <FindingMarks width={width.value} margins={margins} />}
        {isOverTime &&
          rows.map((stream, index) => (
            <Row
              key={stream.key}
              stream={stream}
              width={width.value}
              row_px={row_px}
              hasTimeAxis={index === rows.length - 1}
              margins={margins}
            />
          ))}
        {isOverTime && rows.length > 0 && <Cursor width={width.value} margins={margins} />}
      </div>
    </div>
  );
}

function byKey(event: KeyboardEvent): void {
  const [from_s, to_s] = shown.value;
  const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
  if (by !== 0 && event.target === event.currentTarget) {
    event.preventDefault();
    event.stopPropagation();
    goTo((flightCursor_s.value ?? from_s) + (by * (to_s - from_s)) / 100);
  }
}

function DrawerHead() {
  return (
    <div class="drawer-head">
      <PlayButton playing={playing.value} onClick={togglePlaying} />
      <span class="drawer-time">
        <CursorTime /> of {number(whole.value[1], 2)} s
      </span>
      {opened.value.map(({ name }, i) => (
        <FlightTag key={name} name={name} place={i} />
      ))}
      {opened.value.length > 1 && <Alignment />}
      <StreamChoice />
      <KindChoice />
      {stretch.value !== null && (
        <button type="button" class="toggle" onClick={() => (stretch.value = null)}>
          All of it
        </button>
      )}
      <button type="button" class="link drawer-link" onClick={() => void copyLink()}>
        Copy link
      </button>
    </div>
  );
}

function CursorTime() {
  return <b>{number(flightCursor_s.value ?? 0, 2)} s</b>;
}

/** A flight that is open; all but the first can be moved in time, by hand or by `Alignment`. */
function FlightTag({ name, place }: { name: string; place: number }) {
  const by_s = moved_s.value.get(name) ?? 0;
  return (
    <span class={`badge flight-tag ${place === 0 ? "accent" : ""}`}>
      {LETTERS[place]} <span class="tag-name">{name}</span>
      {place > 0 && (
        <label>
          <span class="visually-hidden">Shift of {name} in seconds</span>
          <input
            type="number"
            step="0.01"
            value={by_s}
            onChange={(event) => {
              const value = Number(event.currentTarget.value);
              if (Number.isFinite(value)) moved_s.value = new Map(moved_s.value).set(name, value);
            }}
          />{" "}
          s
        </label>
      )}
    </span>
  );
}

const EVENTS: readonly [by: AlignBy, word: string, title: string][] = [
  ["trajectory", "Trajectory", "Trajectories begin at the same time"],
  ["take_off", "Take-off", "Both rise 0.1 m over where they stood at the same time"],
  ["motion", "First motion", "Both become faster than 0.15 m/s at the same time"],
  ["speed", "Speed", "By the largest correlation of the speeds"],
  ["height", "Height", "By the largest correlation of the heights"],
];

/** Buttons that move the flights beside the first. */
function Alignment() {
  return (
    <span class="alignment" role="group" aria-label="Align with the first flight by">
      <span class="quiet" aria-hidden="true">
        Align by
      </span>
      {EVENTS.map(([by, word, title]) => (
        <button key={by} type="button" class="toggle" title={title} onClick={() => void align(by)}>
          {word}
        </button>
      ))}
    </span>
  );
}

function StreamChoice() {
  const groups: readonly [Stream["group"], string][] = [
    ["flight", "Flight"],
    ["force", "Force and torque"],
    ["column", "Columns of the log"],
  ];
  return (
    <select
      class="toggle stream-choice"
      aria-label="Add or remove a stream"
      value=""
      onChange={(event) => {
        if (event.currentTarget.value === FORMULA) writing.value = true;
        else toggleStream(event.currentTarget.value);
        event.currentTarget.value = "";
      }}
    >
      <option value="">+ Stream</option>
      <option value={FORMULA}>Formula ...</option>
      {groups.map(([group, words]) => (
        <optgroup key={group} label={words}>
          {offered.value
            .filter((stream) => stream.group === group)
            .map((stream) => (
              <option key={stream.key} value={stream.key}>
                {streamKeys.value.includes(stream.key) ? "✓ " : ""}
                {stream.name}
                {stream.unit !== "" && ` (${stream.unit})`}
              </option>
            ))}
        </optgroup>
      ))}
    </select>
  );
}

// --- one row ---

interface Margins {
  left: number;
  right: number;
}

interface Drawn {
  letter: string;
  place: number;
  time_s: number[];
  curve: CurvePart;
  band: number | null;
}

/** The curves of a stream, flight after flight, on the time that they are shown at. */
function curvesOf(stream: Stream): Drawn[] {
  return opened.value.flatMap(({ name }, place) => {
    const part: StreamPart | undefined = parts.value.get(partKey(name, stream.key));
    if (part === undefined) return [];
    const by_s = moved_s.value.get(name) ?? 0;
    const time_s = by_s === 0 ? part.time_s : part.time_s.map((each) => each + by_s);
    return part.curves.map((curve) => ({ letter: LETTERS[place] ?? "", place, time_s, curve, band: part.band }));
  });
}

const COLOURS = { measured: "measured", plan: "planned", model: "model", residual: "residual" } as const;

function dashOf({ place, curve }: Drawn): number[] {
  if (place > 0) return [2, 3];
  return curve.kind === "plan" ? [4, 3] : curve.kind === "model" ? [7, 2] : [];
}

interface RowProps {
  stream: Stream;
  width: number;
  row_px: number;
  hasTimeAxis: boolean;
  margins: Margins;
}

function Row({ stream, width, row_px, hasTimeAxis, margins }: RowProps) {
  const target = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const curves = curvesOf(stream);
  const shape = curves.map(({ letter, curve }) => letter + curve.label).join("\n");
  const isThemeLight = isLight.value;
  useEffect(() => {
    if (target.current === null || curves.length === 0) return undefined;
    const made = drawRow(target.current, curves, width, plotHeight(row_px, hasTimeAxis), hasTimeAxis, margins);
    plot.current = made;
    const stop = follow(made);
    return () => {
      stop();
      made.destroy();
      plot.current = null;
    };
  }, [shape, width, row_px, hasTimeAxis, margins, isThemeLight]);
  useSignalEffect(() => {
    const [min, max] = shown.value;
    const now = curvesOf(stream);
    const shaded = [moments.value, marks.value];
    const made = plot.current;
    if (made === null || now.length === 0 || made.series.length !== now.length + 1 || shaded.length === 0) return;
    made.setData(joined(now), false);
    made.setScale("x", { min, max });
  });
  return (
    <div class="plot-row">
      <Label stream={stream} curves={curves} />
      <div class="plot-box">
        <div ref={target} class="plot" role="img" aria-label={`${stream.name} over time`} style={{ minHeight: `${row_px}px` }} />
      </div>
    </div>
  );
}

function roomy(low: number | null, high: number | null): [number, number] {
  if (low === null || high === null) return [-1, 1];
  const room = 0.08 * Math.max(high - low, 1e-6 * Math.max(1, Math.abs(high)));
  return [low - room, high + room];
}

/** One table of all curves; flights have times of their own. */
function joined(curves: readonly Drawn[]): uPlot.AlignedData {
  const tables = new Map<number[], (number | null)[][]>();
  const order: [number[], number][] = [];
  for (const { time_s, curve } of curves) {
    const columns = tables.get(time_s) ?? [];
    order.push([time_s, columns.length]);
    columns.push(curve.values);
    tables.set(time_s, columns);
  }
  const each = [...tables].map(([time_s, columns]): uPlot.AlignedData => [time_s, ...columns]);
  const [first] = each;
  if (each.length === 1 && first !== undefined) return first;
  return uPlot.join(each, each.map(([, ...columns]) => [1, ...columns.map(() => 1)] as uPlot.JoinNullMode[]));
}

function drawRow(
  target: HTMLElement,
  curves: readonly Drawn[],
  width: number,
  height: number,
  hasTimeAxis: boolean,
  margins: Margins,
): uPlot {
  const [min, max] = shown.peek();
  const axis = {
    font: `10.5px ${getComputedStyle(document.body).fontFamily}`,
    stroke: () => token("text3"),
    ticks: { show: false },
    grid: { stroke: () => token("grid"), width: 1 },
  };
  return new uPlot(
    {
      width,
      height,
      padding: [6, margins.right, 4, 0],
      legend: { show: false },
      cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: false, dist: 5 } },
      scales: { x: { time: false, min, max }, y: { range: (_plot, low, high) => roomy(low, high) } },
      axes: [
        {
          ...axis,
          size: hasTimeAxis ? AXIS_PX : 0,
          gap: 4,
          values: (_plot, ticks) => ticks.map((tick) => (hasTimeAxis ? `${editable(tick)} s` : "")),
        },
        {
          ...axis,
          size: margins.left,
          gap: 6,
          space: 22,
          values: (_plot, ticks) => ticks.map((tick) => (phone.peek() ? "" : editable(tick))),
        },
      ],
      series: [
        {},
        ...curves.map((each) => ({
          stroke: () => token(COLOURS[each.curve.kind]),
          width: each.curve.kind === "plan" ? 1.2 : 1.5,
          dash: dashOf(each),
          points: { show: false },
        })),
      ],
      hooks: {
        drawClear: [(made) => shade(made, curves)],
        setSelect: [
          (made) => {
            const { left, width: wide } = made.select;
            if (wide < 5) return;
            stretch.value = [made.posToVal(left, "x"), made.posToVal(left + wide, "x")];
            made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          },
        ],
      },
    },
    joined(curves),
    target,
  );
}

/** The moments of the chosen bin, where checks found something, and the band of white noise, behind the curves. */
function shade(made: uPlot, curves: readonly Drawn[]): void {
  const { ctx, bbox } = made;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.fillStyle = token("selected");
  for (const { flight, from_s, to_s } of moments.peek()) {
    if (!opened.peek().some(({ name }) => name === flight)) continue;
    const by_s = moved_s.peek().get(flight) ?? 0;
    const x = made.valToPos(from_s + by_s, "x", true);
    ctx.fillRect(x, bbox.top, Math.max(2, made.valToPos(to_s + by_s, "x", true) - x), bbox.height);
  }
  ctx.globalAlpha = 0.2;
  for (const { finding, from_s, to_s } of marks.peek()) {
    ctx.fillStyle = token(finding.level === "error" ? "danger" : "caution");
    const x = made.valToPos(from_s, "x", true);
    ctx.fillRect(x, bbox.top, Math.max(2, made.valToPos(to_s, "x", true) - x), bbox.height);
  }
  const band = curves[0]?.band ?? null;
  if (band !== null) {
    const y = made.valToPos(band, "y", true);
    ctx.globalAlpha = 0.5;
    ctx.fillStyle = token("line");
    ctx.fillRect(bbox.left, y, bbox.width, made.valToPos(-band, "y", true) - y);
  }
  ctx.restore();
}

/** The pointer over a plot moves the cursor; a double click shows all; the wheel with Ctrl zooms. */
function follow(made: uPlot): () => void {
  const timeAt = (event: MouseEvent): number =>
    made.posToVal(event.clientX - made.over.getBoundingClientRect().left, "x");
  const move = (event: PointerEvent): void => {
    if (event.pointerType === "mouse" && event.buttons !== 0 && event.type === "pointermove") return;
    const time_s = timeAt(event);
    if (Number.isFinite(time_s)) goTo(time_s);
  };
  const all = (): void => void (stretch.value = null);
  const wheel = (event: WheelEvent): void => {
    const [from_s, to_s] = shown.peek();
    if (event.ctrlKey) {
      event.preventDefault();
      const at_s = timeAt(event);
      const by = Math.exp(event.deltaY / 300);
      stretch.value = [at_s + by * (from_s - at_s), at_s + by * (to_s - at_s)];
    } else if (event.shiftKey) {
      event.preventDefault();
      const by_s = ((event.deltaY + event.deltaX) / 1000) * (to_s - from_s);
      stretch.value = [from_s + by_s, to_s + by_s];
    }
  };
  made.over.addEventListener("pointermove", move);
  made.over.addEventListener("pointerdown", move);
  made.over.addEventListener("dblclick", all);
  made.over.addEventListener("wheel", wheel, { passive: false });
  return () => {
    made.over.removeEventListener("pointermove", move);
    made.over.removeEventListener("pointerdown", move);
    made.over.removeEventListener("dblclick", all);
    made.over.removeEventListener("wheel", wheel);
  };
}

function Label({ stream, curves }: { stream: Stream; curves: readonly Drawn[] }) {
  return (
    <div class="plot-label flight-label">
      <span class="plot-name">
        {stream.name} <span class="unit">{stream.unit}</span>
      </span>
      {curves.slice(0, 4).map((each) => (
        <span key={each.letter + each.curve.label} class="curve-line">
          <svg width="16" height="8" aria-hidden="true">
            <line
              x1="0"
              x2="16"
              y1="4"
              y2="4"
              stroke={`var(--${COLOURS[each.curve.kind]})`}
              stroke-width="2"
              stroke-dasharray={dashOf(each).join(" ")}
            />
          </svg>
          <span class="quiet">
            {open.value.length > 1 && `${each.letter} `}
            {each.curve.label === stream.name ? "value" : each.curve.label}
          </span>
          <ValueAt curve={each} />
        </span>
      ))}
    </div>
  );
}

function ValueAt({ curve }: { curve: Drawn }) {
  const moment_s = flightCursor_s.value;
  const { time_s } = curve;
  if (moment_s === null || time_s.length === 0) return <b>–</b>;
  let low = 0;
  let high = time_s.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((time_s[middle] ?? 0) < moment_s) low = middle + 1;
    else high = middle;
  }
  const value = curve.curve.values[low];
  const isOutside = moment_s < (time_s[0] ?? 0) || moment_s > (time_s.at(-1) ?? 0);
  return <b>{value === null || value === undefined || isOutside ? "–" : short(value)}</b>;
}

function Cursor({ width, margins }: { width: number; margins: Margins }) {
  const [from_s, to_s] = shown.value;
  const time_s = flightCursor_s.value;
  if (time_s === null || time_s < from_s || time_s > to_s) return null;
  const x = margins.left + ((width - margins.left - margins.right) * (time_s - from_s)) / (to_s - from_s);
  return <div class="cursor-line" style={{ transform: `translateX(${x}px)` }} />;
}
