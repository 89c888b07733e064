/** The 3D view, and over it the scale of the path's colours. */

import type { ComponentChildren } from "preact";
import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { canDraw } from "../../core/machine";
import { show } from "../timeline/cursor";
import { number, short } from "../../core/format";
import { listenIn } from "./keys";
import { LETTERS, horizon_s, opened, pathColour, showOurs, withArrows, withPredicted } from "../compare/flights";
import type { Channel } from "../compare/flights";
import { CIVIDIS, CLEARANCE, CLEARANCE_SPAN_M, COULD_HIDE_SPAN_MM, SIGNED, SURFACE_STD_SPAN_MM, pathEnds } from "../../plots/scales";
import type { PathColour as Colour } from "../../plots/scales";
import { comparison, connected, figures, flightsShown, mapShown, othersFlights, preflight, series, step, view, viewScales } from "../../core/store";
import { isLight, narrow, token } from "../../core/theme";
import type { Series } from "../../core/protocol";
import { figure } from "../learn/Learn";
import { MapTools, MeasureReadout } from "../map/MapTools";
import { TopView } from "../view/TopView";
import { ViewChoice } from "../view/ViewChoice";
import { isCoarse, isSimplified, measure, watchPace } from "../view/pace";
import { scaleBar } from "../view/place";
import { VIEW, fromAbove, isLoaded, look } from "../view/view";
import { useBox } from "../../plots/width";

/** A busy page loads the 3D view all the same after this; and how often it is looked whether that has drawn. */
const [IDLE_MS, LOOK_AGAIN_MS] = [1000, 100];

const COLOURS: readonly { key: Colour; name: string; unit: string }[] = [
  { key: "clearance", name: "Clearance", unit: "m" },
  { key: "could_hide", name: "Could hide", unit: "mm" },
  { key: "speed", name: "Speed", unit: "m/s" },
  { key: "thrust", name: "Thrust", unit: "N" },
  { key: "rotor_margin", name: "Rotor margin", unit: "%" },
  { key: "tilt", name: "Tilt", unit: "°" },
];

/** The 3D view is loaded once the rest of the page is there and it is known how fast this machine draws. */
const isMeasured = signal(false);

const stopMeasuring = effect(() => {
  if (!canDraw || !connected.value || look.value === "top") return;
  queueMicrotask(() => stopMeasuring());
  whenIdle(() => void measure().then(() => (isMeasured.value = true)));
});

function whenIdle(run: () => void): void {
  if ("requestIdleCallback" in window) requestIdleCallback(run, { timeout: IDLE_MS });
  else setTimeout(run, 0);
}

export function Scene() {
  const frame = useRef<HTMLIFrameElement>(null);
  const light = isLight.value;
  useEffect(() => paintBackground(frame.current), [light]);
  useEffect(() => () => void (isLoaded.value = false), []); // on other steps there is none
  return (
    <main class="scene">
      {isMeasured.value && (
        <iframe
          ref={frame}
          class={`${fromAbove.value ? "behind" : ""} ${isCoarse.value ? "coarse" : ""}`}
          src={`/viser/of/${VIEW}/`}
          title="3D view of map and path"
          onLoad={(event) => {
            const inside = event.currentTarget.contentWindow;
            if (inside === null) return;
            listenIn(inside);
            paintBackground(event.currentTarget);
            whenDrawn(inside, () => {
              isLoaded.value = true;
              watchPace();
            });
          }}
        />
      )}
      {fromAbove.value ? <TopView /> : <Scale3D />}
      <ViewChoice />
      <div class="legends">
        <SimplifiedNote />
        {step.value === 4 ? <FlightLegend /> : <PathLegend />}
        <OthersLegend />
        <SliceLegend />
        <MeasureReadout />
      </div>
      {step.value === 1 && <MapTools />}
    </main>
  );
}

/** How long metres are at the point that the camera looks at; it moves with the camera. */
function Scale3D() {
  const line = useRef<HTMLDivElement>(null);
  const size = useBox(line);
  const height_m = viewScales.value.heights_m[VIEW] ?? 0;
  const scale = height_m > 0 ? size.value.height / height_m : 0;
  const long_m = scale > 0 ? scaleBar(scale) : 0;
  return (
    <div class="scale-3d" ref={line}>
      {long_m > 0 && (
        <p class="scale">
          <span class="bar" style={{ width: `${long_m * scale}px` }} />
          <span>{long_m} m where the camera looks</span>
        </p>
      )}
    </div>
  );
}

/** As long as it holds: what is flown by must not be missing unsaid. */
function SimplifiedNote() {
  if (!isSimplified.value || fromAbove.value || mapShown.value === null) return null;
  return (
    <div class="legend" role="note">
      <p>3D is simplified: thin objects may be missing. Top has them.</p>
    </div>
  );
}

/** Call back when the 3D view's page has drawn something, unless it is gone by then. */
function whenDrawn(inside: Window, run: () => void): void {
  if (inside.closed) return;
  if (inside.document.querySelector("canvas") !== null) run();
  else setTimeout(() => whenDrawn(inside, run), LOOK_AGAIN_MS);
}

/** Give the 3D view the theme's colour behind everything; its canvas is transparent there. */
function paintBackground(frame: HTMLIFrameElement | null): void {
  frame?.contentDocument?.documentElement?.style.setProperty("--scene", token("scene"));
}

function PathLegend() {
  const current = COLOURS.find(({ key }) => key === view.value.colour) ?? COLOURS[0];
  const shown = series.value;
  if (shown === null || current === undefined) return null;
  const isClearance = current.key === "clearance";
  return (
    <>
      <Legend
        unit={current.unit}
        colours={isClearance ? CLEARANCE : CIVIDIS}
        ends={ends(current.key, shown)}
        {...(current.key === "could_hide" ? { note: couldHideNote(shown) } : {})}
      >
        <ColourChoice />
      </Legend>
      <SimulatedLegend />
    </>
  );
}

/** The layer of the preflight's flights, which always have the colours of clearance. */
function SimulatedLegend() {
  const paths = preflight.value?.paths ?? [];
  if (paths.length === 0) return null;
  const { colour, flights: areShown } = view.value;
  return (
    <div class="legend simulated-legend">
      <label class="legend-switch">
        <input
          type="checkbox"
          checked={areShown}
          disabled={!connected.value}
          onChange={(event) => show({ flights: event.currentTarget.checked })}
        />
        <span>{paths.length} simulated flights</span>
      </label>
      {areShown && colour !== "clearance" && (
        <>
          <div class="legend-bar" style={{ background: `linear-gradient(90deg, ${CLEARANCE.join(",")})` }} />
          <div class="legend-ends">
            <span>{clearanceEnds()[0]}</span>
            <span>{clearanceEnds()[1]} m</span>
          </div>
        </>
      )}
      {areShown && (
        <p class="legend-ends quiet">
          <span>by clearance; thick: the worst</span>
          <span class="touching-key">touches, lost</span>
        </p>
      )}
    </div>
  );
}

const RESIDUALS: readonly { key: Channel; name: string }[] = [
  { key: "", name: "Plain paths" },
  ...(["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"] as const).map((key) => ({
    key,
    name: `Residual ${key.startsWith("F") ? "force" : "torque"} ${key.slice(2)}`,
  })),
];

/** What is drawn of recorded flights; in a narrow window it is folded, as it would cover them. */
function FlightLegend() {
  if (opened.value.length === 0) return null;
  const rows = (
    <>
      <PathsLegend />
      <VehicleLegend />
      <ArrowLegend />
    </>
  );
  if (!narrow.value) return <div class="legend">{rows}</div>;
  return (
    <details class="legend">
      <summary>Legend</summary>
      {rows}
    </details>
  );
}

/** Whose flights stand there, where they are not this page's; and that the plan does, where it is another's wish. */
function OthersLegend() {
  const { flights, plan_too } = flightsShown.value;
  const whose = othersFlights.value;
  const isComparing = step.value === 4;
  if (whose !== "") {
    return (
      <div class="legend" role="note">
        <p>
          {whose} looks at {flights.length > 1 ? "flights" : "flight"} {flights.join(", ")} here.
        </p>
        {isComparing && opened.value.length > 0 && (
          <button type="button" class="control" disabled={!connected.value} onClick={showOurs}>
            Show mine instead
          </button>
        )}
      </div>
    );
  }
  if (!isComparing || !plan_too) return null;
  return (
    <div class="legend" role="note">
      <p>The plan stands here too: not everybody is on Compare.</p>
    </div>
  );
}

/** What colours the paths: nothing, or a residual on a scale about zero. */
function PathsLegend() {
  const reach = flightsShown.value.colour_reach;
  return (
    <>
      <div class="legend-head">
        <select
          class="colour-choice"
          aria-label="Colour of the flights' paths"
          value={pathColour.value}
          onChange={(event) => {
            const found = RESIDUALS.find(({ key }) => key === event.currentTarget.value);
            if (found !== undefined) pathColour.value = found.key;
          }}
        >
          {RESIDUALS.map(({ key, name }) => (
            <option key={key} value={key}>
              {name}
            </option>
          ))}
        </select>
        {pathColour.value !== "" && <span class="quiet">body axes</span>}
      </div>
      {pathColour.value === "" ? (
        <div class="legend-ends">
          {opened.value.map(({ name }, i) => (
            <span key={name}>
              <Swatch kind={`path-${i}`} /> {LETTERS[i]} {name}
            </span>
          ))}
        </div>
      ) : (
        <>
          <div class="legend-bar" style={{ background: `linear-gradient(90deg, ${SIGNED.join(",")})` }} />
          <div class="legend-ends">
            <span>{reach === null ? "–" : `≤ ${figure(-reach)}`}</span>
            <span>0</span>
            <span>
              {reach === null ? "–" : `≥ ${figure(reach)}`} {pathColour.value.startsWith("F") ? "N" : "N\u00a0m"}
            </span>
          </div>
        </>
      )}
    </>
  );
}

/** On the scene's colour, as it is drawn there. */
function Swatch({ kind }: { kind: string }) {
  return (
    <span class="swatch" aria-hidden="true">
      <span class={kind} />
    </span>
  );
}

/** The vehicle at the cursor: as measured, planned and predicted; the last two of the first flight. */
function VehicleLegend() {
  const compared = comparison.value;
  const first = opened.value[0]?.name ?? "";
  const isCompared = compared !== null && [...(compared.learn ?? []), ...(compared.held_out ?? [])].includes(first);
  const whose = opened.value.length > 1 ? ` (${LETTERS[0]})` : "";
  return (
    <div class="legend-group">
      <div class="legend-ends">
        <span>
          <Swatch kind="rotor-key" /> measured
        </span>
        <span>
          <Swatch kind="rotor-key pale" /> planned{whose}
        </span>
      </div>
      {isCompared && (
        <div class="legend-switch">
          <label
            class="legend-switch"
            title="As the compared model moves it on from its earlier motion, with the rotor speeds measured"
          >
            <input
              type="checkbox"
              checked={withPredicted.value}
              onChange={(event) => (withPredicted.value = event.currentTarget.checked)}
            />
            <span>
              <Swatch kind="predicted-key" /> predicted{whose}
            </span>
          </label>
          <select
            class="colour-choice"
            aria-label="How long before the prediction begins"
            value={horizon_s.value}
            disabled={!withPredicted.value}
            onChange={(event) => (horizon_s.value = Number(event.currentTarget.value))}
          >
            {compared.horizons_s.map((offered_s) => (
              <option key={offered_s} value={offered_s}>
                from {offered_s} s before
              </option>
            ))}
          </select>
        </div>
      )}
    </div>
  );
}

const rounded = (value: number): string => String(Number(value.toPrecision(1)));

/** The scale of the arrows at the vehicles, per metre. */
function ArrowLegend() {
  const scale = flightsShown.value.arrows;
  if (scale === null && withArrows.value) return null;
  return (
    <div class="legend-group">
      <label class="legend-switch" title="Measured less modelled, mean over 0.1 s, along the world's axes">
        <input
          type="checkbox"
          checked={withArrows.value}
          onChange={(event) => (withArrows.value = event.currentTarget.checked)}
        />
        <span>Residual as arrows</span>
      </label>
      {scale !== null && withArrows.value && (
        <div class="legend-ends">
          <span>
            <Swatch kind="arrow-force" /> Force, 1 m = {rounded(scale.force_n_per_m)} N
          </span>
          <span>
            <Swatch kind="arrow-torque" /> Torque, 1 m = {rounded(scale.torque_n_m_per_m)} N{"\u00a0"}m
          </span>
        </div>
      )}
    </div>
  );
}

function SliceLegend() {
  const slice = mapShown.value?.slice ?? null;
  if (slice === null || (fromAbove.value && slice.axis !== "z")) return null;
  const where = slice.axis === "oblique" ? "oblique" : `${slice.axis} = ${number(slice.at_m, 2)}`;
  if (slice.of === "unknown") {
    return (
      <Legend
        unit=""
        colours={[]}
        ends={["hatched: unknown", "pale: obstacle"]}
        note="violet: plain wall, inferred"
      >
        <b>Unknown space, {where}</b>
      </Legend>
    );
  }
  if (slice.of === "surface_std") {
    return (
      <Legend unit="mm" colours={CIVIDIS} ends={["0", `≥ ${SURFACE_STD_SPAN_MM}`]} note="pale: not measured, or not known">
        <b>Surface, standard deviation, {where}</b>
      </Legend>
    );
  }
  const hides = slice.of === "could_hide";
  return (
    <Legend
      unit={hides ? "mm" : "m"}
      colours={hides ? CIVIDIS : CLEARANCE}
      ends={hides ? ["0", `≥ ${COULD_HIDE_SPAN_MM}`] : clearanceEnds()}
      note={hides ? "hatched: no image looked" : "hatched: below the limit"}
    >
      <b>
        {hides ? "Thinnest object seen" : "Distance"}, {where}
      </b>
    </Legend>
  );
}

interface LegendProps {
  unit: string;
  colours: readonly string[];
  ends: readonly [string, string];
  note?: string;
  children: ComponentChildren;
}

function Legend({ unit, colours, ends, note, children }: LegendProps) {
  return (
    <div class="legend">
      <div class="legend-head">
        {children}
        <span class="quiet">{unit}</span>
      </div>
      {colours.length === 0 ? (
        <div class="legend-bar hatched" />
      ) : (
        <div class="legend-bar" style={{ background: `linear-gradient(90deg, ${colours.join(",")})` }} />
      )}
      <div class="legend-ends">
        <span>{ends[0]}</span>
        <span>{ends[1]}</span>
      </div>
      {note !== undefined && <p class="legend-ends quiet">{note}</p>}
    </div>
  );
}

export function ColourChoice() {
  const chosen = view.value.colour;
  const isKnown = (series.value?.could_hide_mm.length ?? 0) > 0;
  return (
    <select
      class="colour-choice"
      aria-label="Colour of the path"
      value={chosen}
      onChange={(event) => show({ colour: event.currentTarget.value as Colour })}
    >
      {COLOURS.filter(({ key }) => key !== "could_hide" || key === chosen || isKnown).map(({ key, name }) => (
        <option key={key} value={key}>
          {name}
        </option>
      ))}
    </select>
  );
}

/** Words at both ends of the scale; for most figures it spans the path's own values. */
function ends(colour: Colour, shown: Series): [string, string] {
  if (colour === "clearance") return clearanceEnds();
  if (colour === "could_hide") return ["0", `≥ ${COULD_HIDE_SPAN_MM}`];
  const [low, high] = pathEnds(colour, shown);
  return [short(low), short(high)];
}

function clearanceEnds(): [string, string] {
  const required_m = figures.value?.required_clearance_m ?? 0;
  return [`${number(required_m, 2)} limit`, `≥ ${number(required_m + CLEARANCE_SPAN_M, 1)}`];
}

function couldHideNote({ could_hide_mm }: Series): string {
  if (could_hide_mm.length === 0) return "not known: the map has no images";
  return "obstacle that the map may lack within the clearance";
}
