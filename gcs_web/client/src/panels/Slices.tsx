/** A slice through the map: which plane, and what of it. */

import { NumberField } from "../components/NumberField";
import { showMap, toggleLayer } from "../map";
import { connected, mapShown } from "../store";
import type { Layer } from "../map";
import type { Slice } from "../protocol";

type Axis = Slice["axis"];

const AXES: readonly Axis[] = ["x", "y", "z"];
const STEP_M = 0.05;

export const SLICE_OF: readonly { key: Slice["of"]; name: string }[] = [
  { key: "distance", name: "Distance to obstacles" },
  { key: "unknown", name: "Unknown space" },
  { key: "could_hide", name: "Thinnest object seen" },
];

export function Slices() {
  const shown = mapShown.value;
  if (shown === null) return null;
  const { slice, low_m, high_m } = shown;
  const range = (axis: Axis): [number, number] => [low_m[AXES.indexOf(axis)] ?? 0, high_m[AXES.indexOf(axis)] ?? 0];
  const choose = (axis: Axis): void => {
    if (slice?.axis === axis) return showMap({ slice: null });
    const [low, high] = range(axis);
    showMap({ slice: { axis, at_m: Number(((low + high) / 2).toFixed(2)), of: slice?.of ?? "distance" } });
  };
  return (
    <section class="block" aria-labelledby="slice-title">
      <div class="block-head">
        <h3 id="slice-title">Slice</h3>
        <div class="segments" role="group" aria-label="Axis of the slice">
          {AXES.map((axis) => (
            <button
              key={axis}
              type="button"
              aria-pressed={slice?.axis === axis}
              disabled={!connected.value}
              onClick={() => choose(axis)}
            >
              {axis}
            </button>
          ))}
        </div>
      </div>
      {slice !== null && <SlicePlace slice={slice} range={range(slice.axis)} />}
    </section>
  );
}

function SlicePlace({ slice, range }: { slice: Slice; range: [number, number] }) {
  return (
    <div class="slice">
      <select
        class="colour-choice"
        aria-label="What the slice shows"
        value={slice.of}
        disabled={!connected.value}
        onChange={(event) => showMap({ slice: { ...slice, of: event.currentTarget.value as Slice["of"] } })}
      >
        {SLICE_OF.map(({ key, name }) => (
          <option key={key} value={key}>
            {name}
          </option>
        ))}
      </select>
      <input
        type="range"
        aria-label="Place of the slice"
        min={range[0]}
        max={range[1]}
        step={STEP_M}
        value={slice.at_m}
        disabled={!connected.value}
        onInput={(event) => showMap({ slice: { ...slice, at_m: event.currentTarget.valueAsNumber } })}
      />
      <NumberField
        label={slice.axis === "z" ? "Height" : `Place along ${slice.axis}`}
        unit="m"
        value={slice.at_m}
        disabled={!connected.value}
        onCommit={async (value) => {
          showMap({ slice: { ...slice, at_m: value } });
          return "";
        }}
      />
    </div>
  );
}

const LAYERS: readonly { key: Layer; name: string }[] = [
  { key: "mesh", name: "Mesh" },
  { key: "edits", name: "Edits" },
  { key: "cameras", name: "Cameras" },
  { key: "points", name: "Points" },
];

export function Layers() {
  const shown = mapShown.value?.layers ?? [];
  return (
    <section class="block" aria-labelledby="layers-title">
      <div class="block-head">
        <h3 id="layers-title">Layers</h3>
        <div class="layer-row">
          {LAYERS.map(({ key, name }) => (
            <button
              key={key}
              type="button"
              class="toggle"
              aria-pressed={shown.includes(key)}
              disabled={!connected.value || mapShown.value === null}
              onClick={() => toggleLayer(key)}
            >
              {name}
            </button>
          ))}
        </div>
      </div>
    </section>
  );
}
