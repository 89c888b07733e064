/** What is asked of the whole path: laps, take-off and landing, and where the vehicle looks. */

import { change } from "./actions";
import { Choice } from "../../components/Choice";
import { NumberField } from "../../components/NumberField";
import { edit } from "../../core/socket";
import type { EditToSend } from "../../core/socket";
import { connected, doc } from "../../core/store";
import type { Ground, Settings } from "../../core/protocol";
import { Tube } from "./Gate";

export function Mission() {
  if (doc.value === null) return null;
  return (
    <div class="form">
      <Loop />
      <GroundForm end="take_off" name="Take-off" />
      <GroundForm end="landing" name="Landing" />
      <Tube />
      <Yaw />
    </div>
  );
}

const commit = async (command: EditToSend): Promise<string> => (await edit(command)).error;

interface SwitchProps {
  name: string;
  isOn: boolean;
  onChange: (isOn: boolean) => void;
}

function Switch({ name, isOn, onChange }: SwitchProps) {
  return (
    <label class="switch">
      <input
        type="checkbox"
        checked={isOn}
        disabled={!connected.value}
        onChange={(event) => {
          onChange(event.currentTarget.checked);
          event.currentTarget.checked = isOn; // the document decides
        }}
      />
      <b>{name}</b>
    </label>
  );
}

// --- laps ---

function Loop() {
  const mission = doc.value?.mission;
  if (mission === undefined) return null;
  const { laps, lap_first, lap_last } = mission;
  const set = (asked: { laps?: number; lap_first?: number | null; lap_last?: number | null }): EditToSend => ({
    type: "loop",
    laps,
    lap_first,
    lap_last,
    ...asked,
  });
  const ids = (doc.value?.waypoints ?? []).map(({ id }) => id);
  return (
    <section class="form-part" aria-label="Laps">
      <Switch name="Closed loop" isOn={laps > 0} onChange={(isOn) => void change(set({ laps: isOn ? 1 : 0 }))} />
      {laps > 0 && (
        <>
          <NumberField
            label="Laps"
            unit=""
            value={laps}
            disabled={!connected.value}
            onCommit={async (value) =>
              Number.isInteger(value) ? commit(set({ laps: value })) : `${value} is no whole number; type one, like 3`
            }
          />
          <WaypointChoice
            label="From waypoint"
            ids={ids}
            value={lap_first ?? ids.at(0)}
            onChange={(id) => void change(set({ lap_first: id }))}
          />
          <WaypointChoice
            label="To waypoint, and back"
            ids={ids}
            value={lap_last ?? ids.at(-1)}
            onChange={(id) => void change(set({ lap_last: id }))}
          />
        </>
      )}
    </section>
  );
}

interface WaypointChoiceProps {
  label: string;
  ids: readonly number[];
  value: number | undefined;
  onChange: (id: number) => void;
}

function WaypointChoice({ label, ids, value, onChange }: WaypointChoiceProps) {
  return (
    <label class="field">
      <span>{label}</span>
      <span class="field-box">
        <select
          value={value}
          disabled={!connected.value}
          onChange={(event) => {
            onChange(Number(event.currentTarget.value));
            if (value !== undefined) event.currentTarget.value = String(value); // the document decides
          }}
        >
          {ids.map((id, index) => (
            <option key={id} value={id}>
              {index + 1}
            </option>
          ))}
        </select>
      </span>
    </label>
  );
}

// --- take-off and landing ---

type End = "take_off" | "landing";

const COORDINATES: readonly { key: keyof Ground; label: string; unit: string }[] = [
  { key: "x_m", label: "x", unit: "m" },
  { key: "y_m", label: "y", unit: "m" },
  { key: "z_m", label: "z", unit: "m" },
  { key: "climb_m_s", label: "Vertical speed", unit: "m/s" },
];

function GroundForm({ end, name }: { end: End; name: string }) {
  const ground = doc.value?.mission[end] ?? null;
  return (
    <section class="form-part" aria-label={name}>
      <Switch
        name={name}
        isOn={ground !== null}
        onChange={(isOn) => void change(isOn ? { type: "ground", end } : { type: "clear_ground", end })}
      />
      {ground !== null && (
        <>
          <p class="quiet">
            The vehicle&rsquo;s centre as it stands. For other autopilots (goshawk export): ours takes off and lands on
            its own.
          </p>
          {COORDINATES.map(({ key, label, unit }) => (
            <NumberField
              key={key}
              label={label}
              unit={unit}
              value={ground[key]}
              disabled={!connected.value}
              onCommit={(value) => commit({ type: "ground", end, [key]: value })}
            />
          ))}
        </>
      )}
    </section>
  );
}

// --- yaw ---

const YAWS: readonly { key: Settings["yaw"]; name: string; says: string }[] = [
  { key: "along_path", name: "Along the path", says: "The nose points where the vehicle flies." },
  { key: "smooth", name: "Smooth", says: "As little turning as the waypoints’ headings allow." },
  { key: "steady", name: "Steady", says: "The heading of the start, held." },
  { key: "fixed", name: "Fixed", says: "One heading, held." },
  { key: "look_at", name: "To a point", says: "The path slows down where turning needs it." },
  { key: "free", name: "Free", says: "Whatever is fastest." },
];

function Yaw() {
  const settings = doc.value?.settings;
  if (settings === undefined) return null;
  const { yaw, heading_deg, look_at_m } = settings;
  return (
    <section class="form-part" aria-label="Yaw">
      <Choice legend="Yaw" options={YAWS} value={yaw} onChange={(key) => void change({ type: "choose", yaw: key })} />
      {yaw === "fixed" && (
        <NumberField
          label="Heading, from x towards y"
          unit="°"
          value={heading_deg}
          disabled={!connected.value}
          onCommit={(value) => commit({ type: "choose", heading_deg: value })}
        />
      )}
      {yaw === "look_at" &&
        look_at_m !== null &&
        (["x", "y", "z"] as const).map((axis, index) => (
          <NumberField
            key={axis}
            label={`Look at ${axis}`}
            unit="m"
            value={look_at_m[index] ?? 0}
            disabled={!connected.value}
            onCommit={(value) =>
              commit({ type: "choose", look_at_m: look_at_m.with(index, value) as [number, number, number] })
            }
          />
        ))}
    </section>
  );
}
