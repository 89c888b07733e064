/** The plots of the drawer: which streams there are, and how uPlot draws one. */

import uPlot from "uplot";
import { effect, signal } from "@preact/signals";
import { editable, short } from "../core/format";
import { COULD_HIDE_SPAN_MM } from "./scales";
import { series } from "../core/store";
import type { Flown } from "../core/store";
import { token } from "../core/theme";
import type { Limit, Series } from "../core/protocol";

export interface Stream {
  key: string;
  name: string;
  unit: string;
  digits: number;
  curves: (series: Series) => number[][];
  /** Names of the limits that belong to it; drawn if they come in its unit. */
  limits: readonly string[];
  /** The largest value that is drawn, and stands for all above it. */
  most?: number;
  /** What the vehicle did, where that is known. */
  flown?: (sample: Flown) => number;
}

export const STREAMS: readonly Stream[] = [
  { key: "speed", name: "Speed", unit: "m/s", digits: 2, curves: (s) => [s.speed_m_s], limits: ["speed"], flown: (f) => f.speed_m_s },
  { key: "height", name: "Height", unit: "m", digits: 2, curves: (s) => [s.z_m], limits: [], flown: (f) => f.height_m },
  { key: "clearance", name: "Clearance", unit: "m", digits: 2, curves: (s) => [s.clearance_m], limits: ["clearance"] },
  {
    key: "could_hide",
    name: "Could hide",
    unit: "mm",
    digits: 0,
    curves: (s) => (s.could_hide_mm.length > 0 ? [s.could_hide_mm] : []),
    limits: [],
    most: COULD_HIDE_SPAN_MM,
  },
  { key: "tilt", name: "Tilt", unit: "°", digits: 1, curves: (s) => [s.tilt_deg], limits: ["tilt"] },
  {
    key: "acceleration",
    name: "Acceleration",
    unit: "m/s²",
    digits: 2,
    curves: (s) => [s.acceleration_m_s2],
    limits: ["acceleration"],
  },
  {
    key: "rotors",
    name: "Rotor speeds",
    unit: "rad/s",
    digits: 0,
    curves: (s) => [s.rotor_fastest_rad_s, s.rotor_slowest_rad_s],
    limits: ["rotor speed", "slowest rotor"],
  },
  { key: "thrust", name: "Thrust", unit: "N", digits: 1, curves: (s) => [s.thrust_n], limits: [] },
  {
    key: "yaw_rate",
    name: "Yaw rate",
    unit: "°/s",
    digits: 1,
    curves: (s) => [s.yaw_rate_deg_s],
    limits: ["yaw rate"],
  },
];

export function limitsOf(stream: Stream, limits: readonly Limit[]): Limit[] {
  return limits.filter((limit) => stream.limits.includes(limit.name) && limit.unit === stream.unit);
}

/** The stretch of time all plots show; null for all of it. */
export const zoom = signal<readonly [number, number] | null>(null);

effect(() => {
  const end_s = series.value?.time_s.at(-1) ?? Infinity;
  if (zoom.value !== null && zoom.value[0] >= end_s) zoom.value = null; // a shorter plan ends before
});

/** Value of a sampled curve at a moment, straight between samples. */
export function valueAt(time_s: readonly number[], values: readonly number[], moment_s: number): number | null {
  const after = time_s.findIndex((sample_s) => sample_s >= moment_s);
  if (after < 0) return values.at(-1) ?? null;
  const [t0, t1] = [time_s[after - 1], time_s[after]];
  const [v0, v1] = [values[after - 1], values[after]];
  if (t0 === undefined || v0 === undefined || t1 === undefined || v1 === undefined) return v1 ?? null;
  return v0 + ((v1 - v0) * (moment_s - t0)) / (t1 - t0);
}

export interface PlotBox {
  width: number;
  height: number;
  left: number;
  right: number;
  /** The lowest plot also carries the time axis. */
  hasTimeAxis: boolean;
  /** Whether ticks and limits have words, for which the margins need room. */
  hasWords: boolean;
}

const TIME_AXIS_PX = 20;
/** A limit is drawn if it is within this share of the plotted range beyond it. */
const LIMIT_IN_SIGHT = 0.25;

export function plotHeight(row_px: number, hasTimeAxis: boolean): number {
  return row_px + (hasTimeAxis ? TIME_AXIS_PX : 0);
}

interface Range {
  low: number;
  high: number;
  limits: Limit[];
}

/** From nothing (or the lowest value) to the highest, limits included that are near. */
function verticalRange(curves: readonly number[][], limits: readonly Limit[]): Range {
  const values = curves.flat().filter((value) => Number.isFinite(value));
  const highest = Math.max(...values);
  const lowest = Math.min(...values);
  const base = lowest > 0.5 * highest ? lowest : Math.min(0, lowest);
  const margin = LIMIT_IN_SIGHT * (highest - base);
  const inSight = limits.filter((limit) => limit.bound <= highest + margin && limit.bound >= base - margin);
  const bounds = inSight.map((limit) => limit.bound);
  const low = Math.min(base, ...bounds);
  const high = Math.max(highest, ...bounds);
  const room = 0.06 * Math.max(high - low, 1e-6);
  return { low: low === 0 ? 0 : low - room, high: high + room, limits: inSight };
}

function axisStyle() {
  return {
    font: `10.5px ${getComputedStyle(document.body).fontFamily}`,
    stroke: () => token("text3"),
    ticks: { show: false },
    grid: { stroke: () => token("grid"), width: 1 },
  };
}

/** The tracking error over the last minute; `setData` takes seconds (negative: ago) and millimetres. */
export function drawErrors(target: HTMLElement, width: number, height: number): uPlot {
  const axis = axisStyle();
  return new uPlot(
    {
      width,
      height,
      padding: [6, 12, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: [-60, 0] },
        y: { range: (_plot, _low, high) => [0, Math.max(10, 1.1 * high)] },
      },
      axes: [
        { ...axis, size: TIME_AXIS_PX, gap: 4, values: (_plot, ticks) => ticks.map((tick) => `${editable(tick)} s`) },
        { ...axis, size: 32, gap: 6, space: 22, values: (_plot, ticks) => ticks.map(editable) },
      ],
      series: [{}, { stroke: () => token("residual"), width: 1.5, points: { show: false } }],
    },
    [[], []],
    target,
  );
}

export function drawPlot(
  target: HTMLElement,
  stream: Stream,
  series: Series,
  limits: readonly Limit[],
  box: PlotBox,
): uPlot {
  const curves = stream.curves(series);
  const range = verticalRange(curves, limitsOf(stream, limits));
  const axis = axisStyle();
  const plot = new uPlot(
    {
      width: box.width,
      height: box.height,
      padding: [6, box.right, 4, 0],
      legend: { show: false },
      cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: false, dist: 5 } },
      scales: { x: { time: false }, y: { range: [range.low, range.high] } },
      axes: [
        {
          ...axis,
          size: box.hasTimeAxis ? TIME_AXIS_PX : 0,
          gap: 4,
          values: (_plot, ticks) => ticks.map((tick) => (box.hasTimeAxis ? `${editable(tick)} s` : "")),
        },
        {
          ...axis,
          size: box.left,
          gap: 6,
          space: 22,
          values: (_plot, ticks) => ticks.map((tick) => (box.hasWords ? editable(tick) : "")),
        },
      ],
      series: [
        {},
        ...curves.map(() => ({ stroke: () => token("curve"), width: 1.5, points: { show: false } })),
        { stroke: () => token("measured"), width: 2, points: { show: false } },
      ],
      hooks: {
        draw: [(drawn) => drawLimits(drawn, range.limits, box.hasWords ? axis.font : null)],
        setScale: [
          (drawn, key) => {
            if (key === "x") noteZoom(drawn, series);
          },
        ],
      },
    },
    [series.time_s, ...curves, series.time_s.map(() => null)],
    target,
  );
  applyZoom(plot, series);
  return plot;
}

/** Draw what was flown over what is planned, on the plan's times. */
export function drawFlown(plot: uPlot, stream: Stream, series: Series, samples: readonly Flown[]): void {
  const value = stream.flown;
  if (value === undefined) return;
  const [times, values] = [samples.map(({ along_s }) => along_s), samples.map(value)];
  const [first_s, last_s] = [times[0] ?? Infinity, times.at(-1) ?? -Infinity];
  const over = series.time_s.map((time_s) =>
    time_s < first_s || time_s > last_s ? null : valueAt(times, values, time_s),
  );
  plot.setData([series.time_s, ...stream.curves(series), over], false);
  plot.redraw();
}

function noteZoom(plot: uPlot, series: Series): void {
  const { min, max } = plot.scales["x"] ?? {};
  const end_s = series.time_s.at(-1);
  if (min === undefined || max === undefined || min === null || max === null || end_s === undefined) return;
  const isAll = min <= 0 && max >= end_s;
  const before = zoom.peek();
  if (isAll) zoom.value = null;
  else if (before === null || before[0] !== min || before[1] !== max) zoom.value = [min, max];
}

/** Make one plot show what the others show. */
export function applyZoom(plot: uPlot, series: Series): void {
  const [min, max] = zoom.value ?? [0, series.time_s.at(-1) ?? 0];
  const shown = plot.scales["x"];
  if (shown?.min !== min || shown.max !== max) plot.setScale("x", { min, max });
}

export function limitWords(limit: Limit): string {
  return `${limit.sense === "<=" ? "max" : "min"} ${short(limit.bound)}`;
}

function drawLimits(plot: uPlot, limits: readonly Limit[], font: string | null): void {
  const { ctx, bbox } = plot;
  const ratio = devicePixelRatio;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = token("caution");
  ctx.lineWidth = ratio;
  if (font !== null) ctx.font = font.replace("10.5px", `${10.5 * ratio}px`);
  ctx.textBaseline = "middle";
  ctx.textAlign = "left";
  for (const limit of limits) {
    const y = Math.round(plot.valToPos(limit.bound, "y", true));
    ctx.setLineDash([2 * ratio, 3 * ratio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    if (font !== null) ctx.fillText(limitWords(limit), bbox.left + bbox.width + 6 * ratio, y);
  }
  ctx.restore();
}
