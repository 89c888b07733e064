/** The velocity that is asked for at the selected waypoints: begun with the plan's own, edited, dropped. */

import { change } from "./actions";
import { NumberField } from "../../components/NumberField";
import { valueAt } from "../../plots/plots";
import { edit } from "../../core/socket";
import { connected, doc, figures, figuresAreOld, selected } from "../../core/store";
import type { Waypoint } from "../../core/protocol";

type Vector = [number, number, number];

/** Half of the time over which the plan's velocity is taken. */
const STEP_S = 0.02;
const AXES = ["x", "y", "z"] as const;

export function Velocity() {
  const chosen = (doc.value?.waypoints ?? []).filter(({ id }) => selected.value.has(id));
  const [first] = chosen;
  if (first === undefined) return null;
  const waypoints = chosen.map(({ id }) => id);
  const asked = chosen.find(({ velocity_m_s }) => velocity_m_s !== null)?.velocity_m_s ?? null;
  return (
    <section class="velocity" aria-label="Velocity">
      <div class="block-head">
        <b>{title(chosen)}</b>
        <button
          type="button"
          class="link"
          disabled={!connected.value}
          onClick={() =>
            void change({ type: "pass", waypoints, velocity_m_s: asked === null ? plannedVelocity(first.id) : null })
          }
        >
          {asked === null ? "Ask for a velocity" : "Drop"}
        </button>
      </div>
      {asked !== null && (
        <div class="velocity-fields">
          {AXES.map((axis, index) => (
            <NumberField
              key={axis}
              label={`v${axis}`}
              unit="m/s"
              value={asked[index] ?? 0}
              disabled={!connected.value}
              onCommit={async (value) =>
                (await edit({ type: "pass", waypoints, velocity_m_s: asked.with(index, value) as Vector })).error
              }
            />
          ))}
        </div>
      )}
    </section>
  );
}

function title(chosen: readonly Waypoint[]): string {
  const different = new Set(chosen.map(({ velocity_m_s }) => JSON.stringify(velocity_m_s))).size > 1;
  return `Velocity${chosen.length > 1 ? ` at ${chosen.length} waypoints` : ""}${different ? ", differs" : ""}`;
}

/** What the plan has at a waypoint, to a tenth; at rest where there is no plan. */
function plannedVelocity(id: number): Vector {
  const passing = figures.value?.passings.find(({ waypoint }) => waypoint === id);
  const series = figures.value?.series;
  if (figuresAreOld.value || passing === undefined || series == null) return [0, 0, 0];
  const [from_s, to_s] = [Math.max(0, passing.time_s - STEP_S), Math.min(series.time_s.at(-1) ?? 0, passing.time_s + STEP_S)];
  const slope = (values: readonly number[]): number =>
    ((valueAt(series.time_s, values, to_s) ?? 0) - (valueAt(series.time_s, values, from_s) ?? 0)) / (to_s - from_s);
  return [series.x_m, series.y_m, series.z_m].map((values) => Math.round(10 * slope(values)) / 10) as Vector;
}
