/** The timeline: playing, which limit binds when, and plots that share one axis of time and one cursor. */

import { useSignal, useSignalEffect } from "@preact/signals";
import type { Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type uPlot from "uplot";
import { PlayButton } from "../../components/PlayButton";
import { goTo, nextRate, playing, rate, togglePlaying } from "./cursor";
import { number } from "../../core/format";
import { STREAMS, applyZoom, drawFlown, drawPlot, limitWords, limitsOf, plotHeight, valueAt, zoom } from "../../plots/plots";
import type { PlotBox, Stream } from "../../plots/plots";
import { remembered } from "../../core/remembered";
import { cursor_s, figures, figuresAreOld, flown, isFlown, series, step, verdict } from "../../core/store";
import { isLight, phone } from "../../core/theme";
import { BindingStrip, BindingWords } from "./BindingStrip";
import type { Series } from "../../core/protocol";
import { useWidth } from "../../plots/width";

const isKeys = (value: unknown): value is string[] =>
  Array.isArray(value) && value.every((key) => STREAMS.some((stream) => stream.key === key));

const shownStreams = remembered<string[]>("streams", ["speed", "clearance", "tilt"], isKeys);

/** Room for names and axis on the left, for the words of limits on the right. */
const MARGINS = { left: 148, right: 64 };
const PHONE_MARGINS = { left: 16, right: 16 };
const FLY_STEP = 3;
const SMALLEST_ROW_PX = 40;
const PHONE_ROW_PX = 42;
const HEAD_PX = 64; // head and strip
const AXIS_PX = 20;

export function Drawer({ height }: { height?: number }) {
  const current = series.value;
  if (current === null) {
    return (
      <div class="drawer">
        <p class="empty">
          {verdict.value === "refused"
            ? "No path: the plan was refused. The inspector says why, and the way out."
            : "No path yet. Speed, clearance and tilt over time stand here once there is a plan."}
        </p>
      </div>
    );
  }
  const shown = known(current).filter(({ key }) =>
    phone.value ? key === "speed" : shownStreams.value.includes(key),
  );
  const room = (height ?? 0) - HEAD_PX - AXIS_PX;
  const row_px = phone.value ? PHONE_ROW_PX : Math.max(SMALLEST_ROW_PX, Math.floor(room / Math.max(1, shown.length)));
  return (
    <div class={`drawer ${figuresAreOld.value ? "old" : ""}`}>
      {!phone.value && <DrawerHead current={current} />}
      <Plots shown={shown} current={current} row_px={row_px} />
    </div>
  );
}

/** The streams of which the plan has values. */
function known(current: Series): Stream[] {
  return STREAMS.filter((stream) => stream.curves(current).length > 0);
}

function DrawerHead({ current }: { current: Series }) {
  const toggle = (key: string): void => {
    const keys = shownStreams.value;
    shownStreams.value = keys.includes(key) ? keys.filter((each) => each !== key) : [...keys, key];
  };
  return (
    <div class="drawer-head">
      <PlayButton playing={playing.value} onClick={togglePlaying} />
      <span class="drawer-time">
        <CursorTime /> of {number(current.time_s.at(-1), 2)} s
      </span>
      <button type="button" class="toggle" onClick={nextRate} aria-label={`Speed of playing: ${rate.value} times`}>
        {rate.value}×
      </button>
      {known(current).map(({ key, name }) => (
        <button
          key={key}
          type="button"
          class="toggle"
          aria-pressed={shownStreams.value.includes(key)}
          onClick={() => toggle(key)}
        >
          {name}
        </button>
      ))}
      <BindingWords />
    </div>
  );
}

function CursorTime() {
  return <b>{number(cursor_s.value ?? 0, 2)} s</b>;
}

// --- plots ---

function Plots({ shown, current, row_px }: { shown: readonly Stream[]; current: Series; row_px: number }) {
  const box = useRef<HTMLDivElement>(null);
  const width = useWidth(box);
  const margins = phone.value ? PHONE_MARGINS : MARGINS;
  return (
    <div class="plots" ref={box} role="group" aria-label="Plots" tabIndex={0}>
      {!phone.value && <BindingStrip left={margins.left} right={margins.right} width={width.value} />}
      {width.value > 0 &&
        shown.map((stream, index) => (
          <PlotRow
            key={stream.key}
            stream={stream}
            current={current}
            width={width.value}
            row_px={row_px}
            hasTimeAxis={!phone.value && index === shown.length - 1}
            margins={margins}
          />
        ))}
      <CursorLine current={current} width={width} margins={margins} />
    </div>
  );
}

interface Margins {
  left: number;
  right: number;
}

/** Where a moment lies across the plots; null outside of what is shown. */
function across(time_s: number | null, end_s: number, width: number, { left, right }: Margins): number | null {
  const [from_s, to_s] = zoom.value ?? [0, end_s];
  if (time_s === null || time_s < from_s || time_s > to_s || to_s <= from_s) return null;
  return left + ((width - left - right) * (time_s - from_s)) / (to_s - from_s);
}

function CursorLine({ current, width, margins }: { current: Series; width: Signal<number>; margins: Margins }) {
  const x = across(cursor_s.value, current.time_s.at(-1) ?? 0, width.value, margins);
  if (x === null) return null;
  return <div class="cursor-line" style={{ transform: `translateX(${x}px)` }} />;
}

interface RowProps {
  stream: Stream;
  current: Series;
  width: number;
  row_px: number;
  hasTimeAxis: boolean;
  margins: Margins;
}

function PlotRow({ stream, current, width, row_px, hasTimeAxis, margins }: RowProps) {
  const target = useRef<HTMLDivElement>(null);
  const plot = useSignal<uPlot | null>(null);
  const limits = figures.value?.limits ?? [];
  const isThemeLight = isLight.value;
  useEffect(() => {
    if (target.current === null) return undefined;
    const box: PlotBox = {
      width,
      height: plotHeight(row_px, hasTimeAxis),
      ...margins,
      hasTimeAxis,
      hasWords: !phone.value,
    };
    const drawn = drawPlot(target.current, stream, current, limits, box);
    const stop = follow(drawn);
    let isGone = false;
    queueMicrotask(() => !isGone && (plot.value = drawn)); // uPlot lays itself out in a microtask of its own, before
    return () => {
      isGone = true;
      stop();
      plot.value = null;
      drawn.destroy();
    };
  }, [stream, current, limits, width, row_px, hasTimeAxis, isThemeLight]);
  useSignalEffect(() => {
    if (zoom.value !== undefined && plot.value !== null) applyZoom(plot.value, current);
  });
  useSignalEffect(() => {
    const samples = step.value === FLY_STEP ? flown.value : [];
    if (plot.value !== null) drawFlown(plot.value, stream, current, samples);
  });
  return (
    <div class="plot-row">
      <PlotLabel stream={stream} current={current} />
      <div class="plot-box">
        <div ref={target} class="plot" role="img" aria-label={`${stream.name} over time`} />
        <Dots stream={stream} current={current} plot={plot} width={width} margins={margins} />
      </div>
    </div>
  );
}

/** The pointer over a plot moves the cursor; while a button is down it draws the zoom instead. */
function follow(plot: uPlot): () => void {
  const move = (event: PointerEvent): void => {
    const isDrag = event.pointerType === "mouse" && event.buttons !== 0;
    if (isDrag && event.type === "pointermove") return;
    const time_s = plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x");
    if (Number.isFinite(time_s)) goTo(time_s);
  };
  plot.over.addEventListener("pointermove", move);
  plot.over.addEventListener("pointerdown", move);
  return () => {
    plot.over.removeEventListener("pointermove", move);
    plot.over.removeEventListener("pointerdown", move);
  };
}

function PlotLabel({ stream, current }: { stream: Stream; current: Series }) {
  const values = stream
    .curves(current)
    .map((curve) => valueAt(current.time_s, curve, cursor_s.value ?? 0))
    .map((value) => (value !== null && value >= (stream.most ?? Infinity) ? "≥ " : "") + number(value, stream.digits));
  return (
    <div class="plot-label">
      <span class="plot-name">{stream.name}</span>
      <span>
        <b>{values.join(" / ")}</b> <span class="unit">{stream.unit}</span>
        <FlownNow stream={stream} />
        {phone.value && <span class="quiet"> at {number(cursor_s.value ?? 0, 2)} s</span>}
      </span>
      {phone.value && (
        <span class="caution-text">
          {limitsOf(stream, figures.value?.limits ?? [])
            .map(limitWords)
            .join(", ")}
        </span>
      )}
    </div>
  );
}

/** The last value that was flown, beside the planned one. */
function FlownNow({ stream }: { stream: Stream }) {
  const last = flown.value.at(-1);
  if (step.value !== FLY_STEP || last === undefined || stream.flown === undefined || !isFlown.value) return null;
  return <span class="quiet"> flown {number(stream.flown(last), stream.digits)}</span>;
}

interface DotsProps {
  stream: Stream;
  current: Series;
  plot: Signal<uPlot | null>;
  width: number;
  margins: Margins;
}

function Dots({ stream, current, plot, width, margins }: DotsProps) {
  const drawn = plot.value;
  const x = across(cursor_s.value, current.time_s.at(-1) ?? 0, width, margins);
  if (drawn === null || x === null) return null;
  return (
    <>
      {stream.curves(current).map((curve, index) => {
        const value = valueAt(current.time_s, curve, cursor_s.value ?? 0);
        if (value === null) return null;
        const y = drawn.valToPos(value, "y") + drawn.over.offsetTop;
        return <div key={index} class="cursor-dot" style={{ transform: `translate(${x}px, ${y}px)` }} />;
      })}
    </>
  );
}
