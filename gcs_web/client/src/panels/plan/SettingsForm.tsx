/** How fast, how close and by which method: what the pilot asks of the planner besides the mission. */

import { change } from "./actions";
import { Choice } from "../../components/Choice";
import { NumberField } from "../../components/NumberField";
import { edit } from "../../core/socket";
import { connected, doc } from "../../core/store";
import type { Settings } from "../../core/protocol";

type NumberSetting = "speed_m_s" | "acceleration_m_s2" | "jerk_m_s3" | "margin_m";

const NUMBERS: readonly { key: NumberSetting; label: string; unit: string }[] = [
  { key: "speed_m_s", label: "Top speed", unit: "m/s" },
  { key: "acceleration_m_s2", label: "Acceleration", unit: "m/s²" },
  { key: "jerk_m_s3", label: "Jerk", unit: "m/s³" },
  { key: "margin_m", label: "Margin around the vehicle", unit: "m" },
];

const METHODS: readonly { key: Settings["method"]; name: string; says: string }[] = [
  { key: "fastest", name: "Fastest", says: "Shortest time through the waypoints within all limits." },
  { key: "corridor", name: "Corridor", says: "Stays in free corridors between the waypoints." },
];

export function SettingsForm() {
  const settings = doc.value?.settings;
  if (settings === undefined) return null;
  return (
    <div class="form">
      {NUMBERS.map(({ key, label, unit }) => (
        <NumberField
          key={key}
          label={label}
          unit={unit}
          value={settings[key]}
          empty={key === "jerk_m_s3" ? 0 : undefined}
          disabled={!connected.value}
          onCommit={async (value) => (await edit({ type: "choose", [key]: value })).error}
        />
      ))}
      <Choice
        legend="Method"
        options={METHODS}
        value={settings.method}
        onChange={(method) => void change({ type: "choose", method })}
      />
    </div>
  );
}
