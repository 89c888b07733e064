/** The fly step: the vehicle as it is, who is in control, the orders, the flights. */

import { computed } from "@preact/signals";
import { beginHere, canBeginHere, canUpload, giveOrder, mayOrder, openUpload, uploading } from "./orders";
import { NotTold, PreflightLine, isFlownInSimulation } from "./Preflight";
import { UploadPanel } from "./UploadPanel";
import { cards, compareWithLast, lastOfCourse } from "../compare/flights";
import { Badge } from "../../components/Badge";
import { HoldButton } from "../../components/HoldButton";
import { Icon } from "../../components/Icon";
import { Said } from "../../components/Said";
import { age, number, plural, sentenceCase } from "../../core/format";
import { errors, files, foreign, hasVehicle, holdsAnother, inControl, isArmed, isNoGo, isOnlyLookedAt, link, plan, vehicle, verdict } from "../../core/store";
import { submit } from "../../core/socket";
import type { FlightCard, Vehicle as VehicleState } from "../../core/protocol";
import { Control } from "./Control";
import { LinkButtons, VehicleButtons } from "../start/Buttons";
import { ErrorPlot } from "./ErrorPlot";

export function Fly() {
  if (uploading.value !== null) return <UploadPanel state={uploading.value} />;
  return (
    <>
      <Now />
      {errors.value.length > 1 && <ErrorPlot />}
      <IfLinkLost />
      <Failsafes />
      <Landed />
      <BeforeFlight />
      {hasVehicle.value && <Control />}
      <Flights />
      <div class="spring" />
      {hasVehicle.value && <Orders />}
    </>
  );
}

// --- the vehicle now ---

function Now() {
  const last = vehicle.value;
  const { state, age_s } = link.value;
  if (last === null || state === "none") {
    return (
      <section class="verdict">
        <h2>Vehicle</h2>
        <p>
          {files.value.has_vehicle
            ? "No vehicle is connected."
            : "No vehicle is connected, and the project has none that could be simulated."}
        </p>
        <div class="fill">
          {!files.value.has_vehicle && <VehicleButtons />}
          <LinkButtons />
        </div>
      </section>
    );
  }
  return (
    <section class={`verdict live ${state}`} aria-label="Vehicle">
      <div class="block-head">
        <h2>{title(last)}</h2>
        {isOnlyLookedAt.value && state === "stale" ? (
          <Badge>Settings {age(age_s)}</Badge>
        ) : state === "fresh" ? (
          last.armed && <Badge tone="accent">Armed</Badge>
        ) : (
          <Badge tone={state === "lost" ? "danger" : "caution"}>
            {state === "lost" ? "Link lost" : "Stale"}, {age(age_s)}
          </Badge>
        )}
      </div>
      <dl class="figures">
        <Figure name="Error now" value={inMillimetres(last.error_m)} unit="mm" />
        <Figure name="Largest so far" value={inMillimetres(last.largest_error_m)} unit="mm" />
        <Figure name="Battery" value={number(last.battery_v, 2)} unit="V" />
      </dl>
      <p class="quiet">
        <Said text={whereAndWhy(last)} />
      </p>
    </section>
  );
}

function whereAndWhy({ x_m, y_m, z_m, reason }: VehicleState): string {
  const place = x_m === null ? "" : `At ${[x_m, y_m, z_m].map((value) => number(value, 2)).join(", ")} m`;
  if (reason === "") return place || "Heard in flight only.";
  return place === "" ? `Last: ${reason}` : `${place}; last change: ${reason}`;
}

function title({ mission, holds, name }: VehicleState): string {
  if (mission === "trajectory") return `Flying ${holds}`;
  return mission === "" ? name : sentenceCase(mission);
}

function inMillimetres(value_m: number | null): string {
  return number(value_m === null ? null : 1000 * value_m, 0);
}

function Figure({ name, value, unit }: { name: string; value: string; unit: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>
        {value} <span class="unit">{unit}</span>
      </dd>
    </div>
  );
}

/** In flight: what the vehicle does by itself without a link. */
function IfLinkLost() {
  const acts = vehicle.value?.if_link_lost ?? [];
  if (vehicle.value?.armed !== true || acts.length === 0) return null;
  return (
    <section class="block" aria-labelledby="lost-title">
      <h3 id="lost-title">If the link is lost</h3>
      {acts.map(({ after_s, act }) => (
        <p key={act} class="block-head">
          <span>It {act}</span>
          <span class="quiet">after {number(after_s, 1)} s of silence</span>
        </p>
      ))}
    </section>
  );
}

/** Of a vehicle of other firmware: what happens by itself, and whose doing it is. */
function Failsafes() {
  const other = foreign.value;
  if (other === null) return null;
  return (
    <section class="block" aria-labelledby="failsafes-title">
      <h3 id="failsafes-title">Whose failsafe</h3>
      <dl class="failsafes">
        {other.failsafes.map(({ whose, when, act }) => (
          <div key={whose + when}>
            <dt>{whose}</dt>
            <dd>
              <Said text={`If ${when}: ${act}.`} />
            </dd>
          </div>
        ))}
        <div>
          <dt>Kill</dt>
          <dd>
            <Said text={`${sentenceCase(other.kill)}.`} />
          </dd>
        </div>
      </dl>
    </section>
  );
}

/** After a flight: its error, beside that of the last one of the same trajectory. */
function Landed() {
  const [newest] = cards.value;
  if (newest === undefined || vehicle.value?.armed === true || newest.tracking_mean_m === null) return null;
  const before = lastOfCourse(newest.name);
  const mean = (card: FlightCard): string => `${inMillimetres(card.tracking_mean_m)} mm`;
  return (
    <section class="block" aria-label="The last flight">
      <div class="block-head">
        <h3>Last flight</h3>
        <span class="quiet">mean error</span>
      </div>
      <p class="block-head">
        <span>{newest.name}</span>
        <b>{mean(newest)}</b>
      </p>
      {before !== undefined && (
        <p class="block-head quiet">
          <span>{before.name}</span>
          <span>{mean(before)}</span>
        </p>
      )}
      <button type="button" class="control" onClick={() => compareWithLast(newest.name)}>
        {before === undefined ? "Open in Compare" : "Compare with the one before"}
      </button>
    </section>
  );
}

// --- before the flight ---

/** The first thing that must hold before the rotors start and does not. */
const failing = computed(() => vehicle.value?.checks.find(({ passed }) => !passed) ?? null);

/** Whether the list keeps the rotors from being started. */
const isUnfit = computed(() => failing.value !== null || isNoGo.value);

/** So many lines are shown; of more those that pass are counted. */
const MOST_LINES = 10;

function BeforeFlight() {
  const every = vehicle.value?.checks ?? [];
  if (every.length === 0) return null;
  const checks = every.length > MOST_LINES ? every.filter(({ passed }) => !passed) : every;
  return (
    <section class="block" aria-labelledby="before-title">
      <div class="block-head">
        <h3 id="before-title">Before the flight</h3>
        <span class="quiet">{isUnfit.value ? "not fit to arm" : isFlownInSimulation.value ? "all pass" : "all pass, but see below"}</span>
      </div>
      <ul class="checks">
        {checks.map(({ name, passed, finding, remedy }) => (
          <li key={name} class={passed ? "" : "caution-text"}>
            <Icon name={passed ? "check" : "warning"} />
            <span class="visually-hidden">{passed ? "passed" : "failed"}</span>
            <span>
              <b>{sentenceCase(name)}</b> <Said text={finding} />
              {!passed && <span class="remedy"><Said text={sentenceCase(remedy)} />.</span>}
              {!passed && name === "start" && (
                <button type="button" class="control" disabled={!canBeginHere.value} onClick={() => void beginHere()}>
                  Begin the plan here
                </button>
              )}
            </span>
          </li>
        ))}
        {checks.length < every.length && (
          <li>
            <Icon name="check" />
            <span>{plural(every.length - checks.length, "setting is", "settings are")} as expected</span>
          </li>
        )}
        <PreflightLine />
        <NotTold />
      </ul>
      {foreign.value !== null && (
        <button type="button" class="control" disabled={!mayOrder.value} onClick={() => void submit({ type: "look_at_vehicle" })}>
          Look again
        </button>
      )}
    </section>
  );
}

// --- orders ---

function Orders() {
  const onGround = ["disarmed", "armed"].includes(vehicle.value?.mission ?? "");
  const armed = vehicle.value?.armed === true;
  return (
    <div class="acts column">
      <Start />
      {onGround && foreign.value === null && (
        <HoldButton
          act={armed ? "disarm: rotors stop" : "arm only"}
          disabled={!mayOrder.value || (!armed && isUnfit.value)}
          onHeld={() => void giveOrder(armed ? "disarm" : "arm")}
        />
      )}
      {!inControl.value && <p class="quiet centred">Take control to give orders. Abort and Kill need no control.</p>}
    </div>
  );
}

/** The main order: fly what the vehicle holds, or go on with it. */
function Start() {
  const last = vehicle.value;
  if (last?.mission.startsWith("paus") === true) {
    return <HoldButton act="resume" primary disabled={!mayOrder.value} onHeld={() => void giveOrder("resume")} />;
  }
  if (last !== null && last.foreign !== null) return <StartForeign />;
  if (last === null || last.holds_crc32 === "") return <UploadFirst says="The vehicle holds no trajectory." />;
  if (holdsAnother.value) return <UploadFirst says={`The vehicle holds ${last.holds}, not this plan.`} />;
  return (
    <HoldButton
      act={last.armed ? `fly ${last.holds}` : `arm and fly ${last.holds}`}
      primary
      disabled={!mayOrder.value || isUnderWay(last.mission) || isUnfit.value}
      onHeld={() => void giveOrder("start")}
    />
  );
}

/** The station flies the plan itself, or hands it over as the flight starts: nothing is uploaded before. */
function StartForeign() {
  const isChecked = verdict.value === "checked";
  const name = plan.value?.name ?? "the plan";
  return (
    <>
      <HoldButton
        act={`arm and fly ${name}`}
        primary
        disabled={!mayOrder.value || !isChecked || isArmed.value || isUnfit.value || link.value.state === "lost"}
        onHeld={() => void giveOrder("start")}
      />
      {!isChecked && <p class="quiet centred">Only a checked plan can be flown.</p>}
    </>
  );
}

function UploadFirst({ says }: { says: string }) {
  return (
    <>
      <p class="caution-text">{says}</p>
      <button type="button" class="control primary" disabled={!canUpload.value} onClick={openUpload}>
        Compare and upload
      </button>
      {!canUpload.value && <p class="quiet centred">Only a checked plan can be uploaded.</p>}
    </>
  );
}

/** Whether the vehicle is busy with an order that cannot be followed by a start. */
function isUnderWay(mission: string): boolean {
  return !["", "disarmed", "armed", "hold"].includes(mission);
}

// --- flights ---

function Flights() {
  const { flights } = files.value;
  return (
    <section class="block" aria-labelledby="flights-title">
      <div class="block-head">
        <h3 id="flights-title">Flights</h3>
        {flights.length > 0 && <span class="quiet">{flights.length} recorded</span>}
      </div>
      {flights.length === 0 ? (
        <p class="quiet">No flights yet. Fly a plan; its log is listed here.</p>
      ) : (
        <ul class="list">
          {flights.map((name) => (
            <li key={name}>
              <span class="list-words">{name}</span>
              <button type="button" class="link" aria-label={`Compare ${name}`} onClick={() => compareWithLast(name)}>
                Compare
              </button>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}
