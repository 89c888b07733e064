/** Brand, steps, vehicle line and Abort: always there, never covered. */

import { abort } from "../fly/orders";
import { Icon } from "../../components/Icon";
import { Keys } from "../../components/Keys";
import { PANELS } from "./panels";
import { age, checksum, number } from "../../core/format";
import {
  aborting,
  connected,
  connection,
  files,
  holdsAnother,
  isOnlyLookedAt,
  link,
  plan,
  projectsOpen,
  step,
  vehicle,
  verdict,
  welcome,
} from "../../core/store";

export function TopBar() {
  return (
    <header class="top">
      <div class="brand">
        <Icon name="goshawk" />
        <h1>Goshawk</h1>
        {welcome.value !== null && (
          <button
            type="button"
            class="project"
            aria-haspopup="dialog"
            title="Projects"
            onClick={() => (projectsOpen.value = true)}
          >
            <span class="project-name">{welcome.value.project}</span> <Icon name="down" />
          </button>
        )}
      </div>
      <StepBar />
      <VehicleLine />
      <AbortButton />
    </header>
  );
}

function StepBar() {
  return (
    <nav class="steps" aria-label="Steps">
      {PANELS.filter((each) => each.step > 0).map((each) => (
        <button
          key={each.step}
          type="button"
          aria-current={step.value === each.step ? "step" : undefined}
          onClick={() => (step.value = each.step)}
        >
          <span class="step-number">{each.step}</span>
          <span>{each.name}</span>
          <StepMark of={each.step} />
        </button>
      ))}
    </nav>
  );
}

function StepMark({ of }: { of: number }) {
  const done = of === 1 ? connected.value && files.value.has_map : of === 2 && verdict.value === "checked";
  const wrong = of === 2 && (verdict.value === "void" || verdict.value === "refused");
  if (done)
    return (
      <span class="mark">
        <Icon name="check" />
        <span class="visually-hidden">done</span>
      </span>
    );
  if (!wrong) return null;
  return (
    <span class="mark caution-text">
      <Icon name="warning" />
      <span class="visually-hidden">{verdict.value}</span>
    </span>
  );
}

// --- vehicle line ---

function VehicleLine() {
  const last = vehicle.value;
  const { state } = link.value;
  if (last === null || state === "none") {
    const words = connection.value !== "open" ? "not known" : "none";
    return (
      <dl class="vehicle-line" aria-label="Vehicle">
        <Fact name="Vehicle" value={words} />
      </dl>
    );
  }
  return (
    <dl class={`vehicle-line ${state}`} aria-label="Vehicle">
      <VehicleFact name={last.name} state={vehicleState(last.armed, last.mission).join(", ")} />
      <Holds />
      <LinkFact />
      <Fact name="Battery" value={last.battery_v === null ? "–" : `${number(last.battery_v, 1)} V`} />
    </dl>
  );
}

/** A long name gives way to what the vehicle does. */
function VehicleFact({ name, state }: { name: string; state: string }) {
  return (
    <div class="fact gives-way">
      <dt>Vehicle</dt>
      <dd class="vehicle-fact" title={`${name}, ${state}`}>
        <span class="vehicle-name">{name}</span>
        <span class="vehicle-state">, {state}</span>
      </dd>
    </div>
  );
}

/** "armed, holding", but "disarmed" only once. */
function vehicleState(armed: boolean, mission: string): string[] {
  const state = armed ? "armed" : "disarmed";
  return mission === "" || mission === state ? [state] : [state, mission];
}

function Holds() {
  const held = vehicle.value;
  if (held !== null && held.foreign !== null) return <Fact name="Firmware" value={held.foreign.firmware} kind="gives-way" />;
  if (held === null || held.holds_crc32 === "") return <Fact name="Holds" value="no trajectory" />;
  const isPlan = plan.value !== null && !holdsAnother.value;
  const value = isPlan ? `${held.holds} = plan, ${checksum(held.holds_crc32)}` : `${held.holds}, not this plan`;
  return <Fact name="Holds" value={value} kind={isPlan ? "gives-way" : "gives-way caution-text"} />;
}

function LinkFact() {
  const { state, age_s } = link.value;
  if (state === "lost") return <Fact name="Link" value={`link lost, last ${age(age_s)}`} kind="danger-text" />;
  if (state === "stale" && isOnlyLookedAt.value) return <Fact name="Settings" value={age(age_s)} />;
  if (state === "stale") return <Fact name="Link" value={age(age_s)} kind="caution-text" />;
  return <Fact name="Link" value="fresh" />;
}

function Fact({ name, value, kind = "" }: { name: string; value: string; kind?: string }) {
  return (
    <div class={`fact ${kind}`}>
      <dt>{name}</dt>
      <dd title={value}>{value}</dd>
    </div>
  );
}

// --- abort ---

function AbortButton() {
  const armed = vehicle.value?.armed === true;
  return (
    <button
      type="button"
      class={`abort ${armed ? "filled" : ""}`}
      onClick={() => void abort()}
      aria-keyshortcuts="Shift+Escape"
    >
      <Icon name="stop" />
      {aborting.value ? "Aborting, waiting for the vehicle" : "Abort"}
      {!aborting.value && <Keys of="Shift+Escape" />}
    </button>
  );
}
