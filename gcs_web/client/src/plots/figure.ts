/** Plots as one SVG text, to look at and to keep: rows of curves on their own axes. */

import { token } from "../core/theme";
import { darkToYellow } from "./scales";

export interface FigureCurve {
  name: string;
  /** Token of its colour. */
  colour: string;
  dash?: readonly number[];
  x: readonly number[];
  y: readonly (number | null)[];
  /** Points in place of a line. */
  dots?: boolean;
}

export interface FigureRow {
  title: string;
  curves: readonly FigureCurve[];
  /** Both axes, or only y, by powers of ten. */
  logX?: boolean;
  logY?: boolean;
  /** In place of curves: values over x and y, in colours between their ends. */
  heat?: Heat;
}

export interface Heat {
  x: readonly number[];
  y: readonly number[];
  /** A row over x for each y. */
  values: readonly (readonly number[])[];
  unit: string;
}

export interface Figure {
  rows: readonly FigureRow[];
  xTitle: string;
  /** Of all rows; else each row's own. */
  xEnds?: readonly [number, number];
}

const [LEFT, RIGHT, TOP, BOTTOM] = [64, 16, 22, 34] as const;
const [TICK_PX, DOT_PX] = [70, 1.6];
/** Of a spectrum: what is below so many powers of ten under its peak is left out. */
const DECADES = 7;

type Scale = (value: number) => number;

/** Colours are those of the theme that is shown. */
export function svgOf({ rows, xTitle, xEnds }: Figure, width: number, height: number): string {
  const row_px = (height - BOTTOM) / Math.max(1, rows.length);
  const drawn = rows.map((row, i) => rowOf(row, xEnds, width, i * row_px, row_px));
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="Inter, system-ui, sans-serif" font-size="11"><rect width="${width}" height="${height}" fill="${token("panel")}"/>${drawn.join("")}<text x="${(LEFT + width - RIGHT) / 2}" y="${height - 4}" text-anchor="middle" fill="${token("text2")}">${escaped(xTitle)}</text></svg>`;
}

function rowOf(row: FigureRow, xEnds: Figure["xEnds"], width: number, top: number, row_px: number): string {
  const [left, right, high, low] = [LEFT, width - RIGHT, top + TOP, top + row_px - 2];
  if (row.heat !== undefined) return heatOf(row.title, row.heat, xEnds ?? endsOf(row.heat.x), left, right, high, low - BOTTOM / 2);
  const xs = row.curves.flatMap(({ x }) => x.filter((value) => row.logX !== true || value > 0));
  const ys = row.curves.flatMap(({ y }) => y.filter((value): value is number => value !== null && (row.logY !== true || value > 0)));
  if (xs.length === 0 || ys.length === 0) return legend(row, left, top);
  const [x0, x1] = xEnds ?? endsOf(xs);
  const [y0, y1] = row.logY === true ? [Math.max(endsOf(ys)[0], endsOf(ys)[1] / 10 ** DECADES), endsOf(ys)[1]] : roomy(endsOf(ys));
  const x = scale(x0, x1, left, right, row.logX === true);
  const y = scale(y0, y1, low - BOTTOM / 2, high, row.logY === true);
  const frame = `<rect x="${left}" y="${high}" width="${right - left}" height="${low - BOTTOM / 2 - high}" fill="none" stroke="${token("line2")}"/>`;
  const inside = row.curves.map((curve) => (curve.dots === true ? dots(curve, x, y) : line(curve, x, y, row)));
  return `${ticks(x0, x1, row.logX === true, right - left).map((at) => xTick(at, x(at), high, low - BOTTOM / 2)).join("")}${ticks(y0, y1, row.logY === true, 2 * (low - high)).map((at) => yTick(at, y(at), left, right)).join("")}${frame}${inside.join("")}${legend(row, left, top)}`;
}

function heatOf(title: string, { x, y, values, unit }: Heat, [x0, x1]: readonly [number, number], left: number, right: number, high: number, low: number): string {
  const [sx, sy] = [scale(x0, x1, left, right, false), scale(y[0] ?? 0, y.at(-1) ?? 1, low, high, false)];
  const [least, most] = endsOf(values.map((each) => endsOf(each)).flat());
  const [from, to] = [sx(x[0] ?? x0), sx(x.at(-1) ?? x1)];
  const picture = `<image x="${px(from)}" y="${px(high)}" width="${px(to - from)}" height="${px(low - high)}" preserveAspectRatio="none" href="${heatImage(values, least, most)}"/>`;
  const ends = `${words(Math.round(least))} to ${words(Math.round(most))} ${unit}, dark to yellow`;
  const frame = `<rect x="${left}" y="${high}" width="${right - left}" height="${low - high}" fill="none" stroke="${token("line2")}"/>`;
  return `${picture}${ticks(x0, x1, false, right - left).map((at) => xTick(at, sx(at), low, low)).join("")}${ticks(y[0] ?? 0, y.at(-1) ?? 1, false, 2 * (low - high)).map((at) => yTick(at, sy(at), left, left)).join("")}${frame}<text x="${left}" y="${px(high - 8)}" fill="${token("text1")}"><tspan font-weight="600">${escaped(title)}</tspan><tspan dx="12" fill="${token("text3")}">${escaped(ends)}</tspan></text>`;
}

/** A pixel for each value, the first row below. */
function heatImage(values: Heat["values"], least: number, most: number): string {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [values[0]?.length ?? 1, values.length];
  const context = canvas.getContext("2d");
  if (context === null) return "";
  const picture = context.createImageData(canvas.width, canvas.height);
  values.forEach((row, i) => {
    row.forEach((value, k) => {
      const share = (value - least) / Math.max(most - least, 1e-9);
      picture.data.set([...darkToYellow(share), 255], 4 * ((values.length - 1 - i) * canvas.width + k));
    });
  });
  context.putImageData(picture, 0, 0);
  return canvas.toDataURL();
}

function endsOf(values: readonly number[]): [number, number] {
  return values.reduce<[number, number]>(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}

function roomy([low, high]: [number, number]): [number, number] {
  const room = 0.06 * (high - low) || Math.abs(high) || 1;
  return [low - room, high + room];
}

function scale(from: number, to: number, start: number, end: number, isLog: boolean): Scale {
  const of = isLog ? Math.log10 : (value: number): number => value;
  const span = of(to) - of(from) || 1;
  const inside = (share: number): number => Math.min(Math.max(share, 0), 1);
  return (value) => start + inside((of(value) - of(from)) / span) * (end - start);
}

/** Round numbers, or powers of ten, not closer than can be read. */
function ticks(from: number, to: number, isLog: boolean, room_px: number): number[] {
  const most = Math.max(2, Math.floor(room_px / TICK_PX));
  if (isLog) {
    const [first, last] = [Math.ceil(Math.log10(from)), Math.floor(Math.log10(to))];
    const by = Math.max(1, Math.ceil((last - first + 1) / most));
    return Array.from({ length: Math.max(0, Math.floor((last - first) / by) + 1) }, (_, i) => Number(`1e${first + i * by}`));
  }
  const power = 10 ** Math.floor(Math.log10((to - from) / most || 1));
  const by = power * ([1, 2, 5, 10].find((step) => (to - from) / (step * power) <= most) ?? 10);
  const first = Math.ceil(from / by);
  return Array.from({ length: Math.floor(to / by) - first + 1 }, (_, i) => Number(((first + i) * by).toPrecision(12)));
}

const xTick = (value: number, at: number, high: number, low: number): string =>
  `<path d="M${px(at)} ${px(high)}V${px(low)}" stroke="${token("grid")}"/><text x="${px(at)}" y="${px(low + 12)}" text-anchor="middle" fill="${token("text3")}">${words(value)}</text>`;
const yTick = (value: number, at: number, left: number, right: number): string =>
  `<path d="M${left} ${px(at)}H${right}" stroke="${token("grid")}"/><text x="${left - 6}" y="${px(at + 4)}" text-anchor="end" fill="${token("text3")}">${words(value)}</text>`;

function line({ colour, dash, x, y }: FigureCurve, sx: Scale, sy: Scale, { logX, logY }: FigureRow): string {
  let path = "";
  let isUp = false;
  x.forEach((at, i) => {
    const value = y[i] ?? null;
    const isThere = value !== null && (logX !== true || at > 0) && (logY !== true || value > 0);
    if (isThere) path += `${isUp ? "L" : "M"}${px(sx(at))} ${px(sy(value))}`;
    isUp = isThere;
  });
  return `<path d="${path}" fill="none" stroke="${token(colour)}" stroke-width="1.4" stroke-dasharray="${(dash ?? []).join(" ")}"/>`;
}

function dots({ colour, x, y }: FigureCurve, sx: Scale, sy: Scale): string {
  const path = x.map((at, i) => (y[i] === null || y[i] === undefined ? "" : `M${px(sx(at))} ${px(sy(y[i]))}h0`)).join("");
  return `<path d="${path}" stroke="${token(colour)}" stroke-width="${2 * DOT_PX}" stroke-linecap="round" stroke-opacity=".6"/>`;
}

function legend({ title, curves }: FigureRow, left: number, top: number): string {
  const names = curves.map(({ name, colour }) => `<tspan dx="12" fill="${token(colour)}">${escaped(name)}</tspan>`);
  return `<text x="${left}" y="${px(top + 14)}" fill="${token("text1")}"><tspan font-weight="600">${escaped(title)}</tspan>${names.join("")}</text>`;
}

/** Of a tick, which is a round number. */
const words = (value: number): string => String(value).replace("-", "\u2212");
const px = (value: number): string => value.toFixed(1);
/** Names come from logs. */
const escaped = (text: string): string => text.replace(/[&<>"']/g, (sign) => `&#${sign.charCodeAt(0)};`);

/** As an address of an image. */
export const asImage = (svg: string): string => `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;

/** Twice as fine as the screen of most. */
const FINENESS = 2;

export async function asPng(svg: string, width: number, height: number): Promise<Blob> {
  const image = new Image();
  image.src = asImage(svg);
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [FINENESS * width, FINENESS * height];
  canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((done, refuse) => canvas.toBlob((made) => (made === null ? refuse(new Error("no picture")) : done(made))));
}
