/** On the map from above: the planned path, what was flown, the moment of the cursor, the vehicle. */

import { number } from "../../core/format";
import { computed } from "@preact/signals";
import { cursor_s, figures, figuresAreOld, flown, link, preflight, series, step, vehicle, view } from "../../core/store";
import { TOUCHING, clearanceColour, pathColours } from "../../plots/scales";
import { valueAt } from "../../plots/plots";
import { cards, opened } from "../compare/flights";
import { goTo } from "../timeline/cursor";
import type { Point } from "./place";

type OnScreen = (point: Point) => readonly [number, number];

const words = (x_m: readonly number[], y_m: readonly number[]): string =>
  x_m.map((x, i) => `${x.toFixed(3)},${(y_m[i] ?? 0).toFixed(3)}`).join(" ");

/** Whether simulated flights stand round the path, which is drawn thin among them. */
const hasSimulated = computed(() => view.value.flights && (preflight.value?.paths.length ?? 0) > 0);

/** In pieces of one colour; grey where the plan is void or being made. */
export function Path() {
  const shown = series.value;
  if (shown === null || step.value === 4) return null;
  const { x_m, y_m, time_s } = shown;
  const old = figuresAreOld.value;
  const colours = old ? x_m.map(() => "") : pathColours(view.value.colour, shown, figures.value?.required_clearance_m ?? 0);
  return (
    <g class={`planned-path ${old ? "old" : ""} ${hasSimulated.value ? "thin" : ""}`}>
      {pieces(colours).map(([from, to]) => (
        <polyline
          key={from}
          points={words(x_m.slice(from, to + 1), y_m.slice(from, to + 1))}
          style={old ? {} : { stroke: colours[from] ?? "" }}
        />
      ))}
      <polyline
        class="touch"
        points={words(x_m, y_m)}
        onPointerDown={(event) => {
          const at = event.currentTarget.getScreenCTM()?.inverse();
          if (at === undefined) return;
          event.stopPropagation();
          const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(at);
          const away = x_m.map((each, i) => Math.hypot(each - x, (y_m[i] ?? 0) - y));
          goTo(time_s[away.indexOf(Math.min(...away))] ?? 0);
        }}
      />
    </g>
  );
}

/** Made once for each preflight: the view is drawn anew with every word of the vehicle. */
const simulated = computed(() => {
  const { paths = [] } = preflight.value ?? {};
  const required_m = figures.value?.required_clearance_m ?? 0;
  return (
    <g class="simulated-flights">
      {paths.toReversed().map(({ x_m, y_m, clearance_m, ends, is_worst }, at) => {
        const colours = clearance_m.map((each, i) => (i >= ends ? TOUCHING : clearanceColour(each, required_m)));
        return (
          <g key={at} class={is_worst ? "worst" : ""}>
            {pieces(colours).map(([from, to]) => (
              <polyline
                key={from}
                points={words(x_m.slice(from, to + 1), y_m.slice(from, to + 1))}
                style={{ stroke: colours[from] ?? "" }}
              />
            ))}
          </g>
        );
      })}
    </g>
  );
});

/** The simulated flights of the plan's preflight, by clearance; the worst on top. */
export function Simulated() {
  return hasSimulated.value && step.value !== 4 ? simulated.value : null;
}

/** First and last index of runs of one colour; a run ends where the next begins. */
function pieces(colours: readonly string[]): [number, number][] {
  const found: [number, number][] = [];
  colours.forEach((colour, i) => {
    const last = found.at(-1);
    if (last === undefined || colours[last[0]] !== colour) found.push([i, i + 1]);
    else last[1] = i + 1;
  });
  return found;
}

/** The recorded flights that are compared. */
export function Flights() {
  return (
    <g>
      {opened.value.map(({ name }, at) => {
        const path_m = cards.value.find((card) => card.name === name)?.path_m ?? [];
        const [x_m, y_m] = [0, 1].map((axis) => path_m.filter((_, i) => i % 2 === axis));
        return <polyline key={name} class={`flown-path compared-${at}`} points={words(x_m ?? [], y_m ?? [])} />;
      })}
    </g>
  );
}

export function Flown() {
  const samples = flown.value;
  if (samples.length < 2 || step.value === 4) return null;
  return <polyline class="flown-path" points={words(samples.map(({ x_m }) => x_m), samples.map(({ y_m }) => y_m))} />;
}

/** Where the plan has the vehicle at the cursor. */
export function Cursor({ at }: { at: OnScreen }) {
  const [shown, moment_s] = [series.value, cursor_s.value];
  if (shown === null || moment_s === null || step.value === 4) return null;
  const [x_m, y_m] = [shown.x_m, shown.y_m].map((values) => valueAt(shown.time_s, values, moment_s) ?? 0);
  const [x, y] = at({ x_m: x_m ?? 0, y_m: y_m ?? 0 });
  return <circle class="planned-now" cx={x} cy={y} r={6} />;
}

/** Radius of the drawn vehicle, in metres and at least in pixels. */
const [VEHICLE_M, LEAST_PX] = [0.2, 11];

/** A ring, and an arrow to where it looks; as old as it is, and by words too. */
export function VehicleMark({ at, scale }: { at: OnScreen; scale: number }) {
  const last = vehicle.value;
  const { state, age_s } = link.value;
  if (last === null || last.x_m === null || last.y_m === null || state === "none") return null;
  const [x, y] = at({ x_m: last.x_m, y_m: last.y_m });
  const radius = Math.max(LEAST_PX, VEHICLE_M * scale);
  const turned_deg = -(180 / Math.PI) * (last.yaw_rad ?? 0);
  return (
    <g class={`vehicle-mark ${state}`} transform={`translate(${x} ${y})`}>
      <circle r={radius} />
      <path transform={`rotate(${turned_deg}) scale(${radius})`} d="M-0.55-0.55L0.85 0L-0.55 0.55L-0.2 0z" />
      {state !== "fresh" && <text y={radius + 16}>{number(age_s, 1)} s ago</text>}
    </g>
  );
}
