/** While the vehicle is armed, on every step and width: what it does now, Pause, Land and Kill. */

import "../fly/fly.css";
import { HoldButton } from "../../components/HoldButton";
import { Keys } from "../../components/Keys";
import { number, sentenceCase } from "../../core/format";
import { link, vehicle } from "../../core/store";
import type { LostLinkAct, Vehicle } from "../../core/protocol";
import { giveOrder, kill, mayOrder } from "../fly/orders";

export function FlightBar() {
  const last = vehicle.value;
  if (last === null || !last.armed) return null;
  const { state, age_s } = link.value;
  return (
    <section class={`flight-bar ${state}`} aria-label="Flight">
      {state === "lost" && (
        <p class="flight-lost danger-text" role="alert">
          {lostWords(last.if_link_lost, age_s)}
        </p>
      )}
      <dl class="flight-values">
        <Value name="Mission" value={sentenceCase(last.mission)} />
        <Value name="Time" value={time(last)} unit="s" />
        <Value name="Speed" value={number(last.speed_m_s, 1)} unit="m/s" />
        <Value name="Height" value={number(last.z_m, 1)} unit="m" />
        <Value name="Error" value={number(last.error_m === null ? null : 1000 * last.error_m, 0)} unit="mm" />
        {state === "fresh" ? (
          <Value name="Battery" value={number(last.battery_v, 1)} unit="V" />
        ) : (
          <Value name={state === "lost" ? "Link lost" : "Link stale"} value={number(age_s, 1)} unit="s" alarm />
        )}
      </dl>
      <div class="flight-orders">
        <button type="button" class="control tall" disabled={!mayOrder.value} onClick={() => void giveOrder("pause")}>
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

/** What the vehicle does by itself now and next, by the silence so far. */
export function lostWords(acts: readonly LostLinkAct[], age_s: number): string {
  if (acts.length === 0) return "Link lost: what the vehicle does now is not known here. Use the RC transmitter.";
  const begun = acts.findLast(({ after_s }) => after_s <= age_s);
  const next = acts.find(({ after_s }) => after_s > age_s);
  const now = begun === undefined ? "the vehicle goes on" : `it ${begun.act}`;
  return `Link lost: ${now}${next === undefined ? "" : `; ${next.act} in about ${number(next.after_s - age_s, 0)} s`}.`;
}

function time({ along_s, duration_s }: Vehicle): string {
  if (along_s === null) return "–";
  return duration_s === null ? number(along_s, 1) : `${number(along_s, 1)} / ${number(duration_s, 1)}`;
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
