/** The map step: a slice through the distance field, and what the path's colour means. */

import { NumberField } from "../components/NumberField";
import { show } from "../cursor";
import { connected, doc, series, step, view } from "../store";
import { Jobs } from "./Jobs";
import { ColourChoice } from "./Scene";

/** The slider reaches this far above and below what is flown. */
const ROOM_M = 1.5;
const STEP_M = 0.05;

export function Map() {
  const height_m = view.value.slice_z_m;
  const [low_m, high_m, middle_m] = heights();
  return (
    <>
      <section class="verdict">
        <h2>Map</h2>
        <p>Mesh and distance field of the project. Edit them with goshawk map edit; a plan made before becomes void.</p>
      </section>
      <section class="block" aria-labelledby="slice-title">
        <div class="block-head">
          <h3 id="slice-title">Slice</h3>
          <label class="switch">
            <input
              type="checkbox"
              checked={height_m !== null}
              disabled={!connected.value}
              onChange={(event) => show({ slice_z_m: event.currentTarget.checked ? middle_m : null })}
            />
            Distance to obstacles
          </label>
        </div>
        {height_m !== null && (
          <div class="slice">
            <input
              type="range"
              aria-label="Height of the slice"
              min={low_m}
              max={high_m}
              step={STEP_M}
              value={height_m}
              disabled={!connected.value}
              onInput={(event) => show({ slice_z_m: event.currentTarget.valueAsNumber })}
            />
            <NumberField
              label="Height"
              unit="m"
              value={height_m}
              disabled={!connected.value}
              onCommit={async (value) => {
                show({ slice_z_m: value });
                return "";
              }}
            />
          </div>
        )}
      </section>
      <section class="block" aria-labelledby="colour-title">
        <div class="block-head">
          <h3 id="colour-title">Colour of the path</h3>
          <ColourChoice />
        </div>
      </section>
      <Jobs />
      <div class="spring" />
      <div class="acts">
        <button type="button" class="control primary grow" onClick={() => (step.value = 2)}>
          Plan on this map
        </button>
      </div>
    </>
  );
}

/** Lowest, highest and middle height that matter: those of the path and around it. */
function heights(): [number, number, number] {
  const flown_m = series.value?.z_m ?? (doc.value?.waypoints ?? []).map((waypoint) => waypoint.z_m);
  const [low_m, high_m] = flown_m.length === 0 ? [0, 0] : [Math.min(...flown_m), Math.max(...flown_m)];
  const round = (value_m: number): number => Number((Math.round(value_m / STEP_M) * STEP_M).toFixed(2));
  return [round(low_m - ROOM_M), round(high_m + ROOM_M), round((low_m + high_m) / 2)];
}
