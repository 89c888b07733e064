/** The 3D view, and over it the scale of the path's colours. */

import { show } from "../cursor";
import { number, short } from "../format";
import { listenIn } from "../keys";
import { CIVIDIS, CLEARANCE_SPAN_M, VIRIDIS } from "../scales";
import { figures, series, view } from "../store";
import type { Series, Show } from "../protocol";

type Colour = NonNullable<Show["colour"]>;

export const COLOURS: readonly { key: Colour; name: string; unit: string }[] = [
  { key: "clearance", name: "Clearance", unit: "m" },
  { key: "speed", name: "Speed", unit: "m/s" },
  { key: "tilt", name: "Tilt", unit: "°" },
  { key: "rotors", name: "Fastest rotor", unit: "rad/s" },
];

export function Scene() {
  return (
    <main class="scene">
      <iframe
        src="/viser/"
        title="3D view of map and path"
        onLoad={(event) => {
          const inside = event.currentTarget.contentWindow;
          if (inside !== null) listenIn(inside);
        }}
      />
      <Legend />
    </main>
  );
}

function Legend() {
  const current = COLOURS.find(({ key }) => key === view.value.colour) ?? COLOURS[0];
  const shown = series.value;
  if (shown === null || current === undefined) return null;
  const [low, high] = ends(current.key, shown);
  const colours = current.key === "clearance" ? [...VIRIDIS].reverse() : CIVIDIS;
  return (
    <div class="legend">
      <div class="legend-head">
        <ColourChoice />
        <span class="quiet">{current.unit}</span>
      </div>
      <div class="legend-bar" style={{ background: `linear-gradient(90deg, ${colours.join(",")})` }} />
      <div class="legend-ends">
        <span>{low}</span>
        <span>{high}</span>
      </div>
    </div>
  );
}

export function ColourChoice() {
  return (
    <select
      class="colour-choice"
      aria-label="Colour of the path"
      value={view.value.colour}
      onChange={(event) => show({ colour: event.currentTarget.value as Colour })}
    >
      {COLOURS.map(({ key, name }) => (
        <option key={key} value={key}>
          {name}
        </option>
      ))}
    </select>
  );
}

/** Words at both ends of the scale: clearance begins at what is required, the others span the path's own values. */
function ends(colour: Colour, shown: Series): [string, string] {
  if (colour === "clearance") {
    const required_m = figures.value?.required_clearance_m ?? 0;
    return [`${number(required_m, 2)} limit`, `≥ ${number(required_m + CLEARANCE_SPAN_M, 1)}`];
  }
  const values = VALUES[colour](shown);
  return [short(Math.min(...values)), short(Math.max(...values))];
}

const VALUES: Readonly<Record<Exclude<Colour, "clearance">, (shown: Series) => number[]>> = {
  speed: (shown) => shown.speed_m_s,
  tilt: (shown) => shown.tilt_deg,
  rotors: (shown) => shown.rotor_fastest_rad_s,
};
