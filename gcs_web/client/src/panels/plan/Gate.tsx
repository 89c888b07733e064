/** The gate round the selected waypoint, and the tube that the whole path keeps in. */

import { change } from "./actions";
import { NumberField } from "../../components/NumberField";
import { edit } from "../../core/socket";
import { connected, doc, selected } from "../../core/store";
import type { Gate as Opening } from "../../core/protocol";

const FIELDS: readonly { key: keyof Opening; label: string; unit: string }[] = [
  { key: "width_m", label: "Width", unit: "m" },
  { key: "height_m", label: "Height", unit: "m" },
  { key: "heading_deg", label: "Heading, from x towards y", unit: "°" },
  { key: "pitch_deg", label: "Pitch, upwards", unit: "°" },
  { key: "roll_deg", label: "Roll, clockwise", unit: "°" },
];

/** For one selected waypoint between the ends of the path. */
export function Gate() {
  const waypoints = doc.value?.waypoints ?? [];
  const index = waypoints.findIndex(({ id }) => selected.value.has(id));
  const waypoint = waypoints[index];
  if (waypoint === undefined || selected.value.size > 1 || index === 0 || index === waypoints.length - 1) return null;
  const { id, gate } = waypoint;
  if (gate === null) {
    return (
      <p class="gate-note">
        <button
          type="button"
          class="link"
          disabled={!connected.value}
          onClick={() => void change({ type: "gate", waypoint: id })}
        >
          Add a gate at waypoint {index + 1}
        </button>
      </p>
    );
  }
  return (
    <section class="form-part gate-form" aria-label={`Gate at waypoint ${index + 1}`}>
      <b>Gate at waypoint {index + 1}</b>
      <p class="quiet">The opening for the vehicle&rsquo;s centre, passed along its heading.</p>
      {FIELDS.map(({ key, label, unit }) => (
        <NumberField
          key={key}
          label={label}
          unit={unit}
          value={gate[key]}
          disabled={!connected.value}
          onCommit={async (value) => (await edit({ type: "gate", waypoint: id, [key]: value })).error}
        />
      ))}
      <button
        type="button"
        class="link"
        disabled={!connected.value}
        onClick={() => void change({ type: "clear_gate", waypoint: id })}
      >
        Drop the gate
      </button>
    </section>
  );
}

const NEW_TUBE_M = 1;

export function Tube() {
  const mission = doc.value?.mission;
  if (mission === undefined) return null;
  const { keep_in_m, keep_in_recorded } = mission;
  return (
    <section class="form-part" aria-label="Keep in a tube">
      <label class="switch">
        <input
          type="checkbox"
          checked={keep_in_m !== null}
          disabled={!connected.value}
          onChange={(event) => {
            void change({ type: "tube", radius_m: event.currentTarget.checked ? NEW_TUBE_M : null });
            event.currentTarget.checked = keep_in_m !== null; // the document decides
          }}
        />
        <b>Keep in a tube</b>
      </label>
      {keep_in_m !== null && (
        <>
          <p class="quiet">
            {keep_in_recorded ? "Round the polyline of the file." : "Round straight lines from waypoint to waypoint."}
          </p>
          <NumberField
            label="Radius"
            unit="m"
            value={keep_in_m}
            disabled={!connected.value}
            onCommit={async (value) => (await edit({ type: "tube", radius_m: value })).error}
          />
        </>
      )}
    </section>
  );
}
