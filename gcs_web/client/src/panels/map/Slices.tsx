/** A slice through the map: which plane, and what of it. */

import { NumberField } from "../../components/NumberField";
import { showMap, toggleLayer } from "./editing";
import { connected, mapShown, measured } from "../../core/store";
import type { Layer } from "./editing";
import type { Slice } from "../../core/protocol";

type Axis = Slice["axis"];

const AXES = ["x", "y", "z"] as const;
const CHOICES: readonly Axis[] = [...AXES, "oblique"];
const FIRST_HEADING_DEG = 45;
const STEP_M = 0.05;

export const SLICE_OF: readonly { key: Slice["of"]; name: string }[] = [
  { key: "distance", name: "Distance to obstacles" },
  { key: "unknown", name: "Unknown space" },
  { key: "could_hide", name: "Thinnest object seen" },
  { key: "surface_std", name: "Surface, standard deviation" },
];

export function Slices() {
  const shown = mapShown.value;
  if (shown === null) return null;
  const { slice, low_m, high_m } = shown;
  const choose = (axis: Axis): void => {
    if (slice?.axis === axis) return showMap({ slice: null });
    const next = { axis, at_m: 0, of: slice?.of ?? "distance", heading_deg: FIRST_HEADING_DEG, tilt_deg: 0 } as const;
    const [low, high] = reach(next, low_m, high_m);
    showMap({ slice: { ...next, at_m: Number(((low + high) / 2).toFixed(2)) } });
  };
  return (
    <section class="block" aria-labelledby="slice-title">
      <div class="block-head">
        <h3 id="slice-title">Slice</h3>
        <div class="segments" role="group" aria-label="Axis of the slice">
          {CHOICES.map((axis) => (
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
      {slice !== null && <SlicePlace slice={slice} range={reach(slice, low_m, high_m)} />}
    </section>
  );
}

type Vector = [number, number, number];

/** As `gcs_web.slices.normal`. */
function normal({ axis, heading_deg, tilt_deg }: Slice): Vector {
  if (axis !== "oblique") return AXES.map((each) => (each === axis ? 1 : 0)) as Vector;
  const [heading, tilt] = [(heading_deg * Math.PI) / 180, (tilt_deg * Math.PI) / 180];
  return [Math.cos(tilt) * Math.cos(heading), Math.cos(tilt) * Math.sin(heading), Math.sin(tilt)];
}

/** Between which places along its normal a slice meets the mapped box. */
function reach(slice: Slice, low: Vector, high: Vector): [number, number] {
  const parts = normal(slice).map((n, i) => [n * (low[i] ?? 0), n * (high[i] ?? 0)]);
  return [
    parts.reduce((sum, ends) => sum + Math.min(...ends), 0),
    parts.reduce((sum, ends) => sum + Math.max(...ends), 0),
  ];
}

/** The upright slice through two points. */
function through([a, b]: readonly Vector[], slice: Slice): Slice | null {
  if (a === undefined || b === undefined) return null;
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  if (Math.hypot(dx, dy) < 1e-3) return null;
  const upright = { ...slice, heading_deg: Number(((Math.atan2(dx, -dy) * 180) / Math.PI).toFixed(2)), tilt_deg: 0 };
  const at_m = normal(upright).reduce((sum, n, i) => sum + n * (a[i] ?? 0), 0);
  return { ...upright, at_m: Number(at_m.toFixed(3)) };
}

const ANGLES = [
  { key: "heading_deg", label: "Normal’s heading, from x towards y" },
  { key: "tilt_deg", label: "Normal’s tilt, upwards" },
] as const;

function Oblique({ slice }: { slice: Slice }) {
  const both = through(measured.value.points_m, slice);
  return (
    <>
      {ANGLES.map(({ key, label }) => (
        <NumberField
          key={key}
          label={label}
          unit="°"
          value={slice[key]}
          disabled={!connected.value}
          onCommit={async (value) => {
            showMap({ slice: { ...slice, [key]: value } });
            return "";
          }}
        />
      ))}
      <button
        type="button"
        class="control"
        disabled={!connected.value || both === null}
        title="Measure two points first"
        onClick={() => both !== null && showMap({ slice: both })}
      >
        Through the two measured points
      </button>
    </>
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
        label={slice.axis === "z" ? "Height" : `Place along ${slice.axis === "oblique" ? "its normal" : slice.axis}`}
        unit="m"
        value={slice.at_m}
        disabled={!connected.value}
        onCommit={async (value) => {
          showMap({ slice: { ...slice, at_m: value } });
          return "";
        }}
      />
      {slice.axis === "oblique" && <Oblique slice={slice} />}
    </div>
  );
}

const LAYERS: readonly { key: Layer; name: string; title?: string }[] = [
  { key: "mesh", name: "Mesh" },
  { key: "edits", name: "Edits" },
  { key: "cameras", name: "Cameras" },
  { key: "points", name: "Points" },
  { key: "axes", name: "Axes", title: "1 m each: x red, y green, z blue; metres along the floor" },
  { key: "heights", name: "Heights", title: "The mesh in colours of height: grey is low, yellow is high" },
];

export function Layers() {
  const shown = mapShown.value?.layers ?? [];
  return (
    <section class="block" aria-labelledby="layers-title">
      <div class="block-head">
        <h3 id="layers-title">Layers</h3>
        <div class="layer-row">
          {LAYERS.map(({ key, name, title = "" }) => (
            <button
              key={key}
              type="button"
              class="toggle"
              title={title}
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
