/** The flight that would answer what is still open, fitted into the map: asked for, seen coming, opened on the Plan step. */

import { submit } from "../socket";
import { connected, files, step } from "../store";
import { JobRows } from "./Jobs";
import { isRunning, startOnFlights } from "./WhereItFails";

const KIND = "next_flight";
const NAME = /^next-flight(-\d+)?$/;
const PLAN_STEP = 2;

export function NextFlight() {
  const proposed = files.value.trajectories.filter(({ name }) => NAME.test(name));
  return (
    <section class="card" aria-label="Next flight">
      <div class="block-head">
        <h3>Next flight</h3>
        <button
          type="button"
          class="control"
          disabled={!connected.value || isRunning(KIND)}
          onClick={() => void startOnFlights(KIND, { out: freeName(proposed.map(({ name }) => name)) })}
        >
          Propose next flight
        </button>
      </div>
      <p class="dim">
        The manoeuvre that tells most of what is still open, with place, heading and size searched for in this map and
        checked. Sent to the vehicle as it is, it flies as it was simulated; opened, its waypoints are planned again.
      </p>
      <JobRows kinds={[KIND]} />
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
