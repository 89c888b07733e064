/** While the vehicle is armed, on every step and width: what it does now, Pause, Land and Kill. */

import "../fly/fly.css";
import { HoldButton } from "../../components/HoldButton";
import { Icon } from "../../components/Icon";
import { Keys } from "../../components/Keys";
import { number, sentenceCase, span } from "../../core/format";
import { computed } from "@preact/signals";
import { connected, controlWords, foreign, link, vehicle } from "../../core/store";
import type { Vehicle } from "../../core/protocol";
import { alarms, blocked, muted, unblock } from "../fly/alarm";
import { giveOrder, kill, mayOrder } from "../fly/orders";

export function FlightBar() {
  const last = vehicle.value;
  if (last === null || !last.armed) return null;
  const { state, age_s, stationHeard } = link.value;
  const [worst] = alarms.value;
  const isSilenced = blocked.value && !muted.value;
  return (
    <section class={`flight-bar ${state} ${worst === undefined && !isSilenced ? "" : "alarmed"}`} aria-label="Flight">
      {worst !== undefined && (
        <p class={`flight-alarm ${worst.level}-text`} role={worst.level === "danger" ? "alert" : "status"}>
          {worst.words}
        </p>
      )}
      {isSilenced && (
        <button type="button" class="link flight-alarm" onClick={unblock}>
          Sound is blocked: click
        </button>
      )}
      <p class="flight-holder">{holderWords.value}</p>
      <dl class="flight-values">
        <Value name="Mission" value={sentenceCase(last.mission)} />
        <Value name="Time" value={time(last)} unit="s" />
        <Value name="Speed" value={number(last.speed_m_s, 1)} unit="m/s" />
        <Value name="Height" value={number(last.z_m, 1)} unit="m" />
        <Value name="Error" value={error(last)} unit="mm" alarm={alarms.value.some(({ key }) => key === "room")} />
        {state === "fresh" ? (
          <Battery {...last} />
        ) : (
          <Value name={`${stationHeard ? "Link" : "Station"} ${state}`} value={number(age_s, 1)} unit="s" alarm />
        )}
      </dl>
      <div class="flight-orders">
        <Sound />
        <button type="button" class="control tall" disabled={!mayOrder.value || foreign.value?.can_pause === false} title={noPause.value} onClick={() => void giveOrder("pause")}>
          Pause <Keys of="p" />
        </button>
        <button type="button" class="control tall" disabled={!mayOrder.value} onClick={() => void giveOrder("land")}>
          Land <Keys of="l" />
        </button>
        <HoldButton act="kill: rotors stop" short="kill" danger onHeld={() => void kill()} />
      </div>
    </section>
  );
}

/** Two pilots each see whose orders count. */
const holderWords = computed(() => {
  if (!connected.value) return "";
  return controlWords.value || "Nobody is in control";
});

const noPause = computed(() => (foreign.value?.can_pause === false ? "This firmware cannot pause: Land ends the flight" : ""));

function Sound() {
  return (
    <button
      type="button"
      class="control tall sound"
      aria-pressed={muted.value}
      aria-label="Mute alarms"
      title={muted.value ? "Alarms are silent (N)" : blocked.value ? "Alarms are blocked" : "Alarms sound (N)"}
      onClick={() => (muted.value = !muted.value)}
    >
      <Icon name={muted.value ? "muted" : "sound"} />
    </button>
  );
}

function time({ along_s, duration_s }: Vehicle): string {
  if (along_s === null) return "–";
  return duration_s === null ? number(along_s, 1) : `${number(along_s, 1)} / ${number(duration_s, 1)}`;
}

/** How far it is off, of the room that there is. */
function error({ error_m, room_m }: Vehicle): string {
  if (error_m === null) return "–";
  return room_m === null ? number(1000 * error_m, 0) : `${number(1000 * error_m, 0)} / ${number(1000 * room_m, 0)}`;
}

/** How long it lasts where that can be said, else its voltage. */
function Battery({ battery_v, battery_left_s }: Vehicle) {
  if (battery_left_s === null) return <Value name="Battery" value={number(battery_v, 1)} unit="V" />;
  return <Value name="Battery" value={span(battery_left_s)} unit="left" />;
}

function Value({ name, value, unit = "", alarm = false }: { name: string; value: string; unit?: string; alarm?: boolean }) {
  return (
    <div class={alarm ? "danger-text" : ""}>
      <dt>{name}</dt>
      <dd>
        {value} <span class="unit">{unit}</span>
      </dd>
    </div>
  );
}
