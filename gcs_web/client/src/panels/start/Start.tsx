/** What the project has and what fills it: a map, a vehicle, flights, a vehicle that is connected. */

import type { ComponentChildren } from "preact";
import { signal, useSignal } from "@preact/signals";
import { Icon } from "../../components/Icon";
import { plural } from "../../core/format";
import { send, submit } from "../../core/socket";
import { connected, files, flights, hasVehicle, jobs, link, model, projectsOpen, step, vehicle } from "../../core/store";
import type { FoundVehicle } from "../../core/protocol";
import { JobForm, JobRows, chosenKind } from "../jobs/Jobs";
import { FlightButtons, LinkButtons, MapButtons, VehicleButtons } from "./Buttons";
import { address, addressOpen, connectTo, needsPoses, poses, takeAny } from "./fill";

export function Start() {
  return (
    <main
      class="start"
      onDragOver={(event) => event.preventDefault()}
      onDrop={(event) => {
        event.preventDefault();
        for (const file of event.dataTransfer?.files ?? []) void takeAny(file);
      }}
    >
      <h2>What do you have?</h2>
      <p class="quiet">Any one of these is enough to begin. Drop files anywhere.</p>
      <Ways />
      <div class="start-cards">
        <MapCard />
        <VehicleCard />
        <FlightsCard />
        <LinkCard />
      </div>
    </main>
  );
}

const EXAMPLE = ["example"];

/** To begin without any of one's own, or elsewhere. */
function Ways() {
  const { has_map, has_vehicle } = files.value;
  const offered = jobs.value.kinds.some(({ name }) => name === "example");
  const runs = jobs.value.jobs.some(({ kind, state }) => kind === "example" && (state === "running" || state === "waiting"));
  return (
    <div class="start-ways">
      {offered && !has_map && !has_vehicle && (
        <button
          type="button"
          class="control"
          disabled={!connected.value || runs}
          onClick={() => void submit({ type: "start_job", kind: "example", arguments: {} })}
        >
          Open the example
        </button>
      )}
      <button type="button" class="control" disabled={!connected.value} onClick={() => (projectsOpen.value = true)}>
        New or recent project
      </button>
      {jobs.value.jobs.some(({ kind }) => kind === "example") && <JobRows kinds={EXAMPLE} />}
    </div>
  );
}

interface CardProps {
  name: string;
  /** Whether the project has it. */
  there: boolean;
  says: string;
  /** Jobs whose form and rows stand here. */
  kinds?: readonly string[];
  children: ComponentChildren;
}

function Card({ name, there, says, kinds = [], children }: CardProps) {
  const offered = jobs.value.kinds.filter((kind) => kinds.includes(kind.name));
  const chosen = offered.filter((kind) => kind.name === chosenKind.value);
  const known = jobs.value.jobs.some(({ kind }) => kinds.includes(kind));
  return (
    <section class={`start-card ${there ? "there" : ""}`} aria-label={name}>
      <h3>
        {name} {there && <Icon name="check" />}
      </h3>
      <p class="quiet">{says}</p>
      {chosen.length > 0 ? <JobForm kinds={chosen} onDone={() => (chosenKind.value = null)} /> : children}
      {known && <JobRows kinds={kinds} />}
    </section>
  );
}

function GoOn({ to, name }: { to: number; name: string }) {
  return (
    <button type="button" class="control" onClick={() => (step.value = to)}>
      {name}
    </button>
  );
}

function MapCard() {
  const { has_map } = files.value;
  return (
    <Card
      name="A map"
      there={has_map}
      says={has_map ? "Plans are checked against it." : "None yet: the grid is in metres."}
      kinds={["import_map", "map"]}
    >
      {has_map ? <GoOn to={1} name="Look at the map" /> : <MapButtons />}
    </Card>
  );
}

function VehicleCard() {
  const { has_vehicle } = files.value;
  const name = model.value?.name ?? "";
  return (
    <Card
      name="A vehicle"
      there={has_vehicle}
      says={has_vehicle ? `${name || "It"} gives limits, size and model.` : "None yet: its limits are unknown."}
      kinds={["new_vehicle", "example_vehicle"]}
    >
      {has_vehicle ? <GoOn to={2} name="Plan with it" /> : <VehicleButtons />}
    </Card>
  );
}

function FlightsCard() {
  const count = flights.value?.flights.length ?? 0;
  return (
    <Card name="Flights" there={count > 0} says={count > 0 ? `${plural(count, "flight", "flights")} recorded.` : "None yet."}>
      {count > 0 && <GoOn to={4} name="Compare them" />}
      <FlightButtons />
    </Card>
  );
}

function LinkCard() {
  const heard = hasVehicle.value;
  const { state } = link.value;
  const says = heard
    ? `${vehicle.value?.name ?? ""}: ${state === "fresh" ? "heard" : "not heard"}.`
    : files.value.has_vehicle
      ? "No vehicle is connected."
      : "The simulator flies the project's vehicle, once there is one.";
  return (
    <Card name="Connect" there={heard && state === "fresh"} says={says} kinds={["simulate"]}>
      {heard ? (
        <>
          <GoOn to={3} name="Fly it" />
          <button type="button" class="control" disabled={!connected.value} onClick={() => void connectTo("")}>
            Disconnect
          </button>
        </>
      ) : addressOpen.value ? (
        <AddressForm />
      ) : (
        <LinkButtons />
      )}
    </Card>
  );
}

/** Who answered when all on this machine and its networks were asked; null: nobody was. */
const answered = signal<readonly FoundVehicle[] | null>(null);

function AddressForm() {
  const refusal = useSignal("");
  const looks = useSignal(false);
  const look = async (): Promise<void> => {
    if (looks.value) return;
    looks.value = true;
    const { error, vehicles } = await send({ type: "look_for_vehicles" });
    [looks.value, refusal.value, answered.value] = [false, error, error === "" ? vehicles : null];
  };
  const connectToIt = async (): Promise<void> => {
    refusal.value = await connectTo(address.value);
  };
  return (
    <form
      class="job-form"
      aria-label="Address of the vehicle"
      onSubmit={(event) => {
        event.preventDefault();
        void connectToIt();
      }}
    >
      <div class="field long">
        <label for="vehicle-address">Address of the vehicle</label>
        <span class="field-box">
          <input
            id="vehicle-address"
            value={address.value}
            onInput={(event) => (address.value = event.currentTarget.value)}
          />
        </span>
        <p class="quiet">
          <code>udp://</code> for our controller; <code>betaflight:tcp://</code>, <code>mavlink:udp://</code> or <code>crazyflie:udp://</code> for others.
        </p>
      </div>
      {needsPoses.value && (
        <div class="field long">
          <label for="vehicle-poses">Its poses arrive at (TUM lines)</label>
          <span class="field-box">
            <input id="vehicle-poses" value={poses.value} onInput={(event) => (poses.value = event.currentTarget.value)} />
          </span>
        </div>
      )}
      <button
        type="button"
        class="control"
        disabled={!connected.value}
        aria-disabled={looks.value}
        onClick={() => void look()}
      >
        {looks.value ? "Looking, 2 s" : "Look on the net"}
      </button>
      {answered.value !== null && !looks.value && (
        <Answers
          onChosen={(url) => {
            address.value = url;
            void connectToIt();
          }}
        />
      )}
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
      <div class="acts-row">
        <button type="button" class="control" onClick={() => (addressOpen.value = false)}>
          Close
        </button>
        <button type="submit" class="control primary grow" disabled={!connected.value}>
          Connect
        </button>
      </div>
    </form>
  );
}

function Answers({ onChosen }: { onChosen: (url: string) => void }) {
  const found = answered.value ?? [];
  if (found.length === 0) return <p class="quiet" role="status">Nobody answered. Is it on, in this network, and with this key?</p>;
  return (
    <div role="status">
      <ul class="list">
      {found.map(({ url, system }) => (
        <li key={url}>
          <span class="list-words">
            {url} <span class="quiet">system {system}</span>
          </span>
          <button type="button" class="link" aria-label={`Connect to ${url}`} onClick={() => onChosen(url)}>
            Connect
          </button>
        </li>
      ))}
      </ul>
    </div>
  );
}
