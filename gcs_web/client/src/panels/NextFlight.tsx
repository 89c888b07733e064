/** The flight that would answer what is still open, fitted into the map: asked for, seen coming, opened as it is. */

import { signal } from "@preact/signals";
import { submit } from "../socket";
import { connected, files, jobs, mapShown, step } from "../store";
import { JobRows } from "./Jobs";
import { isRunning, startOnFlights } from "./WhereItFails";

const KIND = "next_flight";
const NAME = /^next-flight(-\d+)?$/;
const PLAN_STEP = 2;

/** Whether the pilot takes the map although it is doubtful. */
const accepted = signal(false);

export function NextFlight() {
  const doubt = mapShown.value?.facts.doubt ?? "";
  const proposed = files.value.trajectories.filter(({ name }) => NAME.test(name));
  return (
    <section class="card" aria-label="Next flight">
      <div class="block-head">
        <h3>Next flight</h3>
        <button
          type="button"
          class="control"
          disabled={!connected.value || isRunning(KIND) || (doubt !== "" && !accepted.value)}
          onClick={() => void propose(proposed.map(({ name }) => name))}
        >
          Propose next flight
        </button>
      </div>
      <p class="dim">
        The manoeuvre that tells most of what is still open, with place, heading and size searched for in this map and
        checked. It opens on the Plan step as it is, and flies as it was simulated.
      </p>
      {doubt !== "" && (
        <label class="switch">
          <input
            type="checkbox"
            checked={accepted.value}
            onChange={(event) => (accepted.value = event.currentTarget.checked)}
          />
          <span>
            <span class="caution-text">{doubt}</span> Propose in it all the same
          </span>
        </label>
      )}
      {jobs.value.jobs.some(({ kind }) => kind === KIND) && <JobRows kinds={[KIND]} />}
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

async function propose(taken: readonly string[]): Promise<void> {
  await startOnFlights(KIND, { out: freeName(taken), accept_doubtful_map: accepted.value });
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
