/** Many waypoints at once: snapped, turned at random, or taken from a recorded path. */

import { signal, useSignal } from "@preact/signals";
import { useEffect, useId } from "preact/hooks";
import { randomYaw, selectedOrAll } from "./actions";
import { NumberField } from "../../components/NumberField";
import { number, plural } from "../../core/format";
import { edit, latest, send, submit } from "../../core/socket";
import { connected, files, selected } from "../../core/store";
import type { RecordedPath, Snap } from "../../core/protocol";

const SNAPS: readonly { to: Snap["to"]; name: string; label: string; by_m: number }[] = [
  { to: "grid", name: "To a grid", label: "Spacing", by_m: 0.25 },
  { to: "height", name: "To a height above ground", label: "Height", by_m: 1 },
  { to: "clearance", name: "Away from obstacles", label: "Clearance", by_m: 0.6 },
];

export function Arrange() {
  return (
    <details class="arrange">
      <summary>Arrange</summary>
      <Snapping />
      <FromPath />
    </details>
  );
}

function Snapping() {
  const chosen = useSignal<Snap["to"]>("grid");
  const by_m = useSignal<Readonly<Record<string, number>>>({});
  const refusal = useSignal("");
  const id = useId();
  const snap = SNAPS.find(({ to }) => to === chosen.value);
  if (snap === undefined) return null;
  const value = by_m.value[snap.to] ?? snap.by_m;
  const run = async (): Promise<void> => {
    refusal.value = (await edit({ type: "snap", waypoints: selectedOrAll(), to: snap.to, by_m: value })).error;
  };
  const which = selected.value.size > 0 ? `${selected.value.size} selected` : "all";
  return (
    <section class="form-part" aria-label="Snap">
      <div class="field long">
        <label for={id}>Snap</label>
        <span class="field-box">
          <select
            id={id}
            value={snap.to}
            onChange={(event) => {
              chosen.value = event.currentTarget.value as Snap["to"];
              refusal.value = "";
            }}
          >
            {SNAPS.map(({ to, name }) => (
              <option key={to} value={to}>
                {name}
              </option>
            ))}
          </select>
        </span>
      </div>
      <NumberField
        key={snap.to}
        label={snap.label}
        unit="m"
        value={value}
        onCommit={async (next) => {
          by_m.value = { ...by_m.value, [snap.to]: next };
          return "";
        }}
      />
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
      <div class="acts-row">
        <button type="button" class="control grow" disabled={!connected.value} onClick={() => void run()}>
          Snap {which}
        </button>
        <button
          type="button"
          class="control"
          disabled={!connected.value}
          title="A flight to learn the vehicle from should turn: identification sees more"
          onClick={randomYaw}
        >
          Random headings
        </button>
      </div>
    </section>
  );
}

// --- waypoints along a recorded path ---

const found = signal<RecordedPath | null>(null);
const refused = signal("");
const WALK = "";

const sendThin = latest(({ source, tolerance_m }: { source: string; tolerance_m: number }) => ({
  type: "thin_path",
  source,
  tolerance_m,
}), (reply) => {
  refused.value = reply.error;
  found.value = reply.recorded_path;
});

function FromPath() {
  const source = useSignal(WALK);
  const tolerance_m = useSignal(0.1);
  const open = useSignal(false);
  const id = useId();
  const stop = (): void => {
    open.value = false;
    found.value = null;
    refused.value = "";
    void send({ type: "drop_path" });
  };
  useEffect(() => stop, []);
  const look = (): void => sendThin({ source: source.value, tolerance_m: tolerance_m.value });
  if (!open.value) {
    return (
      <button
        type="button"
        class="control"
        disabled={!connected.value}
        onClick={() => {
          open.value = true;
          look();
        }}
      >
        Waypoints from a recorded path
      </button>
    );
  }
  const take = async (): Promise<void> => {
    const asked = { source: source.value, tolerance_m: tolerance_m.value };
    if (await submit({ type: "take_path", ...asked })) stop();
  };
  return (
    <section class="form-part" aria-label="Recorded path">
      <div class="field long">
        <label for={id}>Recorded path</label>
        <span class="field-box">
          <select
            id={id}
            value={source.value}
            onChange={(event) => {
              source.value = event.currentTarget.value;
              look();
            }}
          >
            <option value={WALK}>Walk of the map’s images</option>
            {files.value.flights.map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </span>
      </div>
      <label class="slice">
        <span class="block-head">
          <span>Deviation allowed</span>
          <span class="quiet">{number(tolerance_m.value, 2)} m</span>
        </span>
        <input
          type="range"
          min={0.02}
          max={1}
          step={0.02}
          value={tolerance_m.value}
          disabled={!connected.value}
          onInput={(event) => {
            tolerance_m.value = event.currentTarget.valueAsNumber;
            look();
          }}
        />
      </label>
      {found.value !== null && <p class="quiet">{words(found.value)}</p>}
      {refused.value !== "" && (
        <p class="refusal" role="alert">
          {refused.value}
        </p>
      )}
      <div class="acts-row">
        <button type="button" class="control" onClick={stop}>
          Cancel
        </button>
        <button
          type="button"
          class="control grow strong"
          disabled={!connected.value || found.value === null}
          onClick={() => void take()}
        >
          Replace the waypoints
        </button>
      </div>
    </section>
  );
}

function words({ positions, left_out, waypoints }: RecordedPath): string {
  const out = left_out > 0 ? `, ${left_out} of them too close to obstacles or unknown space` : "";
  return `${plural(waypoints, "waypoint", "waypoints")} for ${positions} recorded positions${out}.`;
}
