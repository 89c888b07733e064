/** The map from above, drawn by the page itself: without WebGL, and before the 3D view is there. */

import type { ComponentChildren } from "preact";
import { useSignal } from "@preact/signals";
import type { Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { number } from "../../core/format";
import { doc, section, selected, step } from "../../core/store";
import type { Waypoint } from "../../core/protocol";
import { change } from "../plan/actions";
import { select } from "../timeline/cursor";
import { useBox } from "../../plots/width";
import type { Size } from "../../plots/width";
import { Cursor, Flights, Flown, Path, Simulated, VehicleMark } from "./drawn";
import { extent, fitted, followed, panned, scaleBar, zoomed } from "./place";
import type { Place, Point } from "./place";

const WHEEL = 1.0015;
const STEP = 1.4;
const COMPARE_STEP = 4;

export function TopView() {
  const box = useRef<HTMLDivElement>(null);
  const size = useBox(box);
  const chosen = useSignal<Place | null>(null);
  const whole = fitted(extent(), size.value);
  const place = followed(chosen.value ?? whole, size.value);
  const isReady = size.value.width > 0;
  useWheel(box, (at, by) => (chosen.value = zoomed(chosen.peek() ?? whole, size.peek(), at, by)));
  return (
    <div class="top-view" ref={box} role="group" aria-label="Map from above">
      {isReady && (
        <svg
          aria-hidden="true"
          width={size.value.width}
          height={size.value.height}
          onPointerDown={(event) => pan(event, place, (next) => (chosen.value = next))}
          onDblClick={() => (chosen.value = null)}
        >
          <g transform={matrix(place, size.value)}>
            <Ground place={place} />
            <Simulated />
            <Path />
            <Flown />
            {step.value === COMPARE_STEP && <Flights />}
          </g>
          {(step.value === COMPARE_STEP ? [] : (doc.value?.waypoints ?? [])).map((point, at) => (
            <Ball key={point.id} point={point} at={at} place={place} size={size.value} />
          ))}
          <Cursor at={(point) => onScreen(point, place, size.value)} />
          <VehicleMark at={(point) => onScreen(point, place, size.value)} scale={place.scale} />
        </svg>
      )}
      {isReady && <Scale place={place} />}
      <div class="zoom" role="toolbar" aria-label="Zoom">
        <Zoom name="Zoom in" by={STEP} chosen={chosen} place={place} size={size.value}>
          +
        </Zoom>
        <Zoom name="Zoom out" by={1 / STEP} chosen={chosen} place={place} size={size.value}>
          −
        </Zoom>
        <button type="button" aria-label="Show all" title="Show all" onClick={() => (chosen.value = null)}>
          ⤢
        </button>
      </div>
    </div>
  );
}

/** From metres, y upwards, to the screen. */
function matrix({ x_m, y_m, scale }: Place, { width, height }: Size): string {
  return `translate(${width / 2 - scale * x_m} ${height / 2 + scale * y_m}) scale(${scale} ${-scale})`;
}

function onScreen({ x_m, y_m }: Point, place: Place, { width, height }: Size): [number, number] {
  return [width / 2 + place.scale * (x_m - place.x_m), height / 2 - place.scale * (y_m - place.y_m)];
}

/** The map's picture, or metres where there is no map. */
function Ground({ place }: { place: Place }) {
  const { image, low_m, high_m } = section.value;
  if (image === "") return <Grid place={place} />;
  return (
    <image
      href={`data:image/png;base64,${image}`}
      x={low_m[0]}
      y={-high_m[1]}
      width={high_m[0] - low_m[0]}
      height={high_m[1] - low_m[1]}
      transform="scale(1 -1)"
      preserveAspectRatio="none"
      class="section-image"
    />
  );
}

const GRID_M = 10;

function Grid({ place }: { place: Place }) {
  const [x_m, y_m] = [Math.round(place.x_m), Math.round(place.y_m)];
  const lines = Array.from({ length: 2 * GRID_M + 1 }, (_, i) => i - GRID_M);
  return (
    <g class="metres">
      {lines.map((i) => (
        <g key={i} class={i === 0 ? "axis" : ""}>
          <line x1={x_m + i} x2={x_m + i} y1={y_m - GRID_M} y2={y_m + GRID_M} />
          <line y1={y_m + i} y2={y_m + i} x1={x_m - GRID_M} x2={x_m + GRID_M} />
        </g>
      ))}
    </g>
  );
}

interface BallProps {
  point: Waypoint;
  at: number;
  place: Place;
  size: Size;
}

/** A waypoint: a click selects it, a drag moves it. */
function Ball({ point, at, place, size }: BallProps) {
  const held = useSignal<Point | null>(null);
  const [x, y] = onScreen(held.value ?? point, place, size);
  const isSelected = selected.value.has(point.id);
  return (
    <g
      class={`ball ${isSelected ? "selected" : ""}`}
      transform={`translate(${x} ${y})`}
      onPointerDown={(event) => {
        event.stopPropagation();
        select([point.id]);
        const revision = doc.value?.revision; // what somebody else does meanwhile was not seen
        drag(
          event,
          (right, down) => (held.value = { x_m: point.x_m + right / place.scale, y_m: point.y_m - down / place.scale }),
          () => {
            const to = held.value;
            if (to === null) return;
            const moved = { x_m: Number(to.x_m.toFixed(2)), y_m: Number(to.y_m.toFixed(2)) };
            void change({ type: "move", waypoints: [point.id], ...moved }, revision).then(() => (held.value = null));
          },
          () => (held.value = null),
        );
      }}
    >
      <circle class="touch" r={22} />
      <circle r={9} />
      <text dy="0.35em">{at + 1}</text>
    </g>
  );
}

function pan(event: PointerEvent, from: Place, take: (place: Place) => void): void {
  drag(event, (right, down) => take(panned(from, right, down)), () => {});
}

const DRAG_PX = 4;

/** Follow a pointer until it is let go, or taken away; what moves less than a few pixels is a click. */
function drag(
  event: PointerEvent,
  move: (right: number, down: number) => void,
  end: () => void,
  cancel: () => void = () => {},
): void {
  if (event.button !== 0 || !(event.currentTarget instanceof Element)) return;
  const target = event.currentTarget;
  const [x, y] = [event.clientX, event.clientY];
  let moves = false;
  target.setPointerCapture(event.pointerId);
  const onMove = (now: Event): void => {
    if (!(now instanceof PointerEvent) || now.pointerId !== event.pointerId) return;
    moves ||= Math.hypot(now.clientX - x, now.clientY - y) >= DRAG_PX;
    if (moves) move(now.clientX - x, now.clientY - y);
  };
  const onEnd = (now: Event): void => {
    if (!(now instanceof PointerEvent) || now.pointerId !== event.pointerId) return;
    target.removeEventListener("pointermove", onMove);
    for (const kind of ["pointerup", "pointercancel"]) target.removeEventListener(kind, onEnd);
    if (now.type === "pointercancel") cancel();
    else if (moves) end();
  };
  target.addEventListener("pointermove", onMove);
  for (const kind of ["pointerup", "pointercancel"]) target.addEventListener(kind, onEnd);
}

/** A wheel over the map; it listens itself, as the page would scroll otherwise. */
function useWheel(box: { current: HTMLDivElement | null }, turn: (at: [number, number], by: number) => void): void {
  const latest = useRef(turn);
  latest.current = turn;
  useEffect(() => {
    const shown = box.current;
    const onWheel = (event: WheelEvent): void => {
      event.preventDefault();
      latest.current([event.offsetX, event.offsetY], WHEEL ** -event.deltaY);
    };
    shown?.addEventListener("wheel", onWheel, { passive: false });
    return () => shown?.removeEventListener("wheel", onWheel);
  }, []);
}

interface ZoomProps {
  name: string;
  by: number;
  chosen: Signal<Place | null>;
  place: Place;
  size: Size;
  children: ComponentChildren;
}

function Zoom({ name, by, chosen, place, size, children }: ZoomProps) {
  const middle: [number, number] = [size.width / 2, size.height / 2];
  return (
    <button type="button" aria-label={name} title={name} onClick={() => (chosen.value = zoomed(place, size, middle, by))}>
      {children}
    </button>
  );
}

/** Of a cut that is no slice: that has a legend of its own. */
const KEY = [
  ["obstacle", "obstacle"],
  ["near", "too near"],
  ["unknown", "unknown"],
] as const;

/** How long a metre is, which way the axes go, and at which height the map is cut. */
function Scale({ place }: { place: Place }) {
  const long_m = scaleBar(place.scale);
  const { image, at_m, of } = section.value;
  return (
    <p class="scale">
      <svg width="34" height="34" aria-hidden="true">
        <path d="M8 26V6M5 9l3-3 3 3M8 26h20M25 23l3 3-3 3" />
        <text x="13" y="11">
          y
        </text>
        <text x="24" y="20">
          x
        </text>
      </svg>
      <span class="bar" style={{ width: `${long_m * place.scale}px` }} />
      <span>
        {long_m} m{image === "" ? "" : `, cut at ${number(at_m, 2)} m`}
      </span>
      {image !== "" && of === null && KEY.map(([kind, words]) => (
        <span key={kind} class="section-key">
          <i class={kind} /> {words}
        </span>
      ))}
    </p>
  );
}
