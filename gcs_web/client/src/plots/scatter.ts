/** Points against a variable, with binned mean and band, on a canvas: quick however many points there are. */

import { editable } from "../core/format";
import { token } from "../core/theme";

export interface Points {
  x: readonly number[];
  y: readonly number[];
  /** Drawn as rings: flights that only judge. */
  rings?: readonly boolean[];
  colour: string;
}

export interface Line {
  x: readonly number[];
  y: readonly number[];
  /** Half the width of a band about it. */
  band?: readonly number[];
  colour: string;
  dash?: readonly number[];
}

export interface Drawing {
  points: readonly Points[];
  lines: readonly Line[];
  /** A shaded range of x. */
  range?: readonly [number, number] | null;
  /** Vertical range that several drawings share. */
  reach?: readonly [number, number];
}

export interface Frame {
  left: number;
  top: number;
  width: number;
  height: number;
  x: readonly [number, number];
  y: readonly [number, number];
}

const MARGIN = { left: 40, right: 8, top: 8, bottom: 22 };
const MOST_POINTS = 6000;

function extent(values: Iterable<number>): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(low <= high)) return [-1, 1];
  const room = 0.06 * (high - low || 1);
  return [low - room, high + room];
}

export function reachOf(drawings: readonly Drawing[]): [number, number] {
  return extent(
    drawings.flatMap(({ points, lines }) => [...points.flatMap(({ y }) => [...y]), ...lines.flatMap(ends), 0]),
  );
}

/** A line's values, or the edges of its band. */
function ends({ y, band }: Line): number[] {
  return band === undefined ? [...y] : y.flatMap((value, i) => [value - (band[i] ?? 0), value + (band[i] ?? 0)]);
}

/** About `count` round numbers within a range. */
export function ticks([low, high]: readonly [number, number], count: number): number[] {
  const rough = (high - low) / count;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((each) => each * size).find((each) => each >= rough) ?? rough;
  const found: number[] = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) found.push(Math.abs(tick) < step / 1e6 ? 0 : tick);
  return found;
}

/** Draw; returns where the axes lie, for clicks. */
export function draw(canvas: HTMLCanvasElement, what: Drawing, width: number, height: number): Frame {
  const ratio = devicePixelRatio;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const frame: Frame = {
    left: MARGIN.left,
    top: MARGIN.top,
    width: width - MARGIN.left - MARGIN.right,
    height: height - MARGIN.top - MARGIN.bottom,
    x: extent([...what.points.flatMap(({ x }) => [...x]), ...what.lines.flatMap(({ x }) => [...x])]),
    y: what.reach ?? reachOf([what]),
  };
  const ctx = canvas.getContext("2d");
  if (ctx === null) return frame;
  ctx.scale(ratio, ratio);
  const px = (x: number): number => frame.left + (frame.width * (x - frame.x[0])) / (frame.x[1] - frame.x[0]);
  const py = (y: number): number => frame.top + frame.height * (1 - (y - frame.y[0]) / (frame.y[1] - frame.y[0]));
  axes(ctx, frame, px, py);
  ctx.save();
  ctx.beginPath();
  ctx.rect(frame.left, frame.top, frame.width, frame.height);
  ctx.clip();
  if (what.range) {
    ctx.fillStyle = token("selected");
    ctx.fillRect(px(what.range[0]), frame.top, Math.max(2, px(what.range[1]) - px(what.range[0])), frame.height);
  }
  for (const points of what.points) drawPoints(ctx, points, px, py);
  for (const line of what.lines) drawLine(ctx, line, px, py);
  ctx.restore();
  return frame;
}

type Place = (value: number) => number;

function axes(ctx: CanvasRenderingContext2D, frame: Frame, px: Place, py: Place): void {
  ctx.font = `10.5px ${getComputedStyle(document.body).fontFamily}`;
  ctx.fillStyle = token("text3");
  ctx.lineWidth = 1;
  ctx.textBaseline = "middle";
  ctx.textAlign = "right";
  for (const tick of ticks(frame.y, Math.max(2, frame.height / 30))) {
    const y = Math.round(py(tick)) + 0.5;
    ctx.strokeStyle = token(tick === 0 ? "line2" : "grid");
    ctx.beginPath();
    ctx.moveTo(frame.left, y);
    ctx.lineTo(frame.left + frame.width, y);
    ctx.stroke();
    ctx.fillText(editable(tick), frame.left - 6, y);
  }
  ctx.textBaseline = "top";
  ctx.textAlign = "center";
  for (const tick of ticks(frame.x, Math.max(2, frame.width / 60))) {
    ctx.fillText(editable(tick), px(tick), frame.top + frame.height + 6);
  }
}

function drawPoints(ctx: CanvasRenderingContext2D, points: Points, px: Place, py: Place): void {
  const every = Math.max(1, Math.ceil(points.x.length / MOST_POINTS));
  for (const ring of [false, true]) {
    ctx.beginPath();
    for (let i = 0; i < points.x.length; i += every) {
      if ((points.rings?.[i] ?? false) !== ring) continue;
      const x = px(points.x[i] ?? 0);
      const y = py(points.y[i] ?? 0);
      const radius = ring ? 2.5 : 1.6;
      ctx.moveTo(x + radius, y);
      ctx.arc(x, y, radius, 0, 2 * Math.PI);
    }
    if (ring) {
      ctx.strokeStyle = token("measured");
      ctx.lineWidth = 1;
      ctx.stroke();
    } else {
      ctx.globalAlpha = 0.6;
      ctx.fillStyle = token(points.colour);
      ctx.fill();
      ctx.globalAlpha = 1;
    }
  }
}

function drawLine(ctx: CanvasRenderingContext2D, line: Line, px: Place, py: Place): void {
  const { band } = line;
  if (band !== undefined) {
    ctx.beginPath();
    line.x.forEach((x, i) => ctx.lineTo(px(x), py((line.y[i] ?? 0) + (band[i] ?? 0))));
    for (let i = line.x.length - 1; i >= 0; i -= 1) ctx.lineTo(px(line.x[i] ?? 0), py((line.y[i] ?? 0) - (band[i] ?? 0)));
    ctx.closePath();
    ctx.globalAlpha = 0.25;
    ctx.fillStyle = token(line.colour);
    ctx.fill();
    ctx.globalAlpha = 1;
  }
  ctx.beginPath();
  line.x.forEach((x, i) => ctx.lineTo(px(x), py(line.y[i] ?? 0)));
  ctx.setLineDash([...(line.dash ?? [])]);
  ctx.strokeStyle = token(line.colour);
  ctx.lineWidth = 1.6;
  ctx.stroke();
  ctx.setLineDash([]);
}
