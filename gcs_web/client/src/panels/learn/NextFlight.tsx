/** The flight that would answer what is still open, fitted into the map: asked for, seen coming, opened as it is. */

import { signal } from "@preact/signals";
import { Said } from "../../components/Said";
import { number, sentenceCase } from "../../core/format";
import { submit } from "../../core/socket";
import { connected, files, mapShown, nextFlight, step } from "../../core/store";
import type { NextFlight as Proposed, Section } from "../../core/protocol";
import { JobRows } from "../jobs/Jobs";
import { isRunning, startOnFlights } from "../compare/WhereItFails";

const KIND = "next_flight";
const NAME = /^next-flight(-\d+)?$/;
const PLAN_STEP = 2;

/** The map that the pilot takes although it is doubtful, with its doubt: of another one it says nothing. */
const accepted = signal("");

export function NextFlight() {
  const { doubt = "", hash = "" } = mapShown.value?.facts ?? {};
  const isAccepted = accepted.value === `${hash} ${doubt}`;
  const found = nextFlight.value;
  const proposed = files.value.trajectories.filter(({ name }) => NAME.test(name));
  return (
    <section class="card" aria-label="Next flight">
      <div class="block-head">
        <h3>Next flight</h3>
        <button
          type="button"
          class="control"
          disabled={!connected.value || isRunning(KIND) || (doubt !== "" && !isAccepted)}
          onClick={() => void propose(proposed.map(({ name }) => name), doubt !== "" && isAccepted)}
        >
          Propose next flight
        </button>
      </div>
      <p class="dim">
        The manoeuvre that tells most of what is still open, placed in this map and checked. It opens in Plan.
      </p>
      {doubt !== "" && (
        <label class="switch">
          <input
            type="checkbox"
            checked={isAccepted}
            onChange={(event) => (accepted.value = event.currentTarget.checked ? `${hash} ${doubt}` : "")}
          />
          <span>
            <span class="caution-text">{doubt}</span> Propose in it all the same
          </span>
        </label>
      )}
      {isRunning(KIND) ? <JobRows kinds={[KIND]} /> : found !== null && found.state !== "none" && <Found found={found} />}
      {proposed.map(({ name, checked }) => (
        <div class="acts-row" key={name}>
          <span>
            <b>{name}</b> <span class="quiet">{checked ? "checked" : "not checked for the map and vehicle as they are now"}</span>
          </span>
          <button
            type="button"
            class="control"
            disabled={!connected.value}
            aria-label={`Open ${name} on the Plan step`}
            onClick={() => void open(name)}
          >
            Open on the Plan step
          </button>
        </div>
      ))}
    </section>
  );
}

function Found({ found }: { found: Proposed }) {
  const isOld = found.state === "old";
  return (
    <>
      {isOld && <p class="caution-text">The vehicle, a flight or the map changed since. Propose again.</p>}
      {found.refusal !== "" ? (
        <p>
          <b>No flight in this map answers what is open.</b> <Said text={sentenceCase(found.refusal)} />.
        </p>
      ) : (
        <div class="proposed">
          {found.section !== null && <FromAbove found={found} section={found.section} />}
          <dl>
            <div>
              <dt class="quiet">Manoeuvre</dt>
              <dd>
                <b>{sentenceCase(found.manoeuvre)}</b> at {Math.round(100 * found.size)} % of its size, turned by{" "}
                {number((180 / Math.PI) * found.heading_rad, 0)}°
              </dd>
            </div>
            <div>
              <dt class="quiet">Flown in</dt>
              <dd>
                {number(found.duration_s, 1)} <span class="unit">s</span>, up to {number(found.top_speed_m_s, 1)}{" "}
                <span class="unit">m/s</span>
              </dd>
            </div>
            <div>
              <dt class="quiet">Nearest obstacle</dt>
              <dd>
                {number(found.clearance_m, 2)} <span class="unit">m</span>, ≥ {number(found.required_clearance_m, 2)} is
                needed
              </dd>
            </div>
            <Odds found={found} />
          </dl>
        </div>
      )}
    </>
  );
}

/** What the flights so far and this one are worth, against what answers the question. */
function Odds({ found }: { found: Proposed }) {
  const { known_log_odds: known, expected_log_odds: expected, needed_log_odds: needed } = found;
  const reach = 1.1 * Math.max(known + expected, needed);
  const share = (value: number): string => `${(100 * Math.max(0, value)) / reach}%`;
  return (
    <div>
      <dt class="quiet">{found.candidates.length > 1 ? `Distinguishes ${found.candidates.join(" from ")}` : `Shows ${found.candidates.join("")}`}</dt>
      <dd>
        <b>
          {number(known, 1)} → {number(known + expected, 1)}
        </b>{" "}
        log odds, ≥ {number(needed, 1)} is 95 % certain
        <div class="odds-bar" aria-hidden="true">
          <span class="known" style={{ width: share(known) }} />
          <span class="expected" style={{ width: share(expected) }} />
          <span class="needed" style={{ left: share(needed) }} />
        </div>
        <span class="quiet">grey: flights so far, blue: this flight, line: answered</span>
      </dd>
    </div>
  );
}

/** The flight over a level cut through the map; shaded where the vehicle has no room. */
function FromAbove({ found, section }: { found: Proposed; section: Section }) {
  const { cell_m, rows } = section;
  const [low_x, low_y] = section.low_m;
  const [width, height] = [(rows[0]?.length ?? 0) * cell_m, rows.length * cell_m];
  const thin = Math.max(width, height) / 110;
  const points: string[] = [];
  for (let k = 0; k + 2 < found.path_m.length; k += 3) {
    points.push(`${(found.path_m[k] ?? 0) - low_x},${height - ((found.path_m[k + 1] ?? 0) - low_y)}`);
  }
  const shaded = rows.flatMap((row, j) =>
    [...row.matchAll(/#+/g)].map(({ 0: run, index }) => {
      const right_m = run.length * cell_m;
      return `M${index * cell_m} ${height - (j + 1) * cell_m}h${right_m}v${cell_m}h${-right_m}z`;
    }),
  );
  const [begin_x, begin_y] = (points[0] ?? "0,0").split(",");
  const words = `${found.manoeuvre} from above, in a map of ${number(width, 1)} by ${number(height, 1)} m`;
  return (
    <figure>
      <svg class="from-above" viewBox={`0 0 ${width} ${height}`} role="img" aria-label={sentenceCase(words)}>
        <path class="no-room" d={shaded.join("")} />
        <polyline class="way" points={points.join(" ")} stroke-width={thin} />
        <circle class="begin" cx={begin_x} cy={begin_y} r={1.4 * thin} />
        <line
          class="metre"
          x1={2 * thin}
          x2={2 * thin + 1}
          y1={height - 3 * thin}
          y2={height - 3 * thin}
          stroke-width={0.6 * thin}
        />
      </svg>
      <figcaption class="quiet">
        From above; the bar is 1 m. Shaded: no room for the vehicle at{" "}
        {number(section.height_m, 1)} m height, or unknown. Dot: where it begins.
      </figcaption>
    </figure>
  );
}

async function propose(taken: readonly string[], accept_doubtful_map: boolean): Promise<void> {
  await startOnFlights(KIND, { out: freeName(taken), accept_doubtful_map });
}

async function open(name: string): Promise<void> {
  await submit({ type: "open", name });
  step.value = PLAN_STEP;
}

/** One that no saved trajectory has. */
function freeName(taken: readonly string[]): string {
  for (let k = 1; ; k += 1) {
    const name = k === 1 ? "next-flight" : `next-flight-${k}`;
    if (!taken.includes(name)) return name;
  }
}
