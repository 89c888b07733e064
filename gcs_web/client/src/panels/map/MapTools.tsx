/** Over the 3D view in the step Map: tools to draw edits and to measure, and what was measured. */

import { Keys } from "../../components/Keys";
import { number } from "../../core/format";
import { TOOLS } from "./tools";
import { connected, mapShown, measured } from "../../core/store";

export function MapTools() {
  return (
    <div class="tools" role="toolbar" aria-label="Map">
      {TOOLS.map((tool) => (
        <button
          key={tool.name}
          type="button"
          aria-pressed={tool.active()}
          disabled={!connected.value || mapShown.value === null}
          onClick={tool.run}
        >
          {tool.name} <Keys of={tool.key} />
        </button>
      ))}
    </div>
  );
}

export function MeasureReadout() {
  const { active, points_m, clearances_m, distance_m } = measured.value;
  if (!active && points_m.length === 0) return null;
  return (
    <div class="legend" role="status">
      <div class="legend-head">
        <b>Measure</b>
        <span class="quiet">m</span>
      </div>
      {points_m.length === 0 && <p class="quiet">Click a point on the mesh or on the slice.</p>}
      {points_m.map((point, i) => (
        <p key={i} class="measured">
          <span>{point.map((value) => number(value, 2)).join(", ")}</span>
          <span class="quiet">clearance {number(clearances_m[i], 2)}</span>
        </p>
      ))}
      {distance_m !== null && (
        <p class="measured">
          <b>Distance</b>
          <b>{number(distance_m, 2)}</b>
        </p>
      )}
    </div>
  );
}
