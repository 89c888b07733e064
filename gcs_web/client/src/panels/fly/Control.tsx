/** Who gives the orders, and taking or giving up that role. */

import { submit } from "../../core/socket";
import { takeControl, takeOver } from "./orders";
import { connected, inControl, people } from "../../core/store";

export function Control() {
  const holder = people.value.people.find(({ id }) => id === people.value.in_control);
  const words = inControl.value
    ? "Your orders go to the vehicle."
    : holder === undefined
      ? "Nobody is in control."
      : `${holder.name} is in control.`;
  return (
    <section class="block" aria-labelledby="control-title">
      <div class="block-head">
        <h3 id="control-title">Control</h3>
        <span class="quiet">{words}</span>
      </div>
      {inControl.value ? (
        <button
          type="button"
          class="control"
          disabled={!connected.value}
          onClick={() => void submit({ type: "give_up_control" })}
        >
          Give up control
        </button>
      ) : (
        <button
          type="button"
          class="control"
          disabled={!connected.value}
          onClick={holder === undefined ? takeControl : takeOver}
        >
          {holder === undefined ? "Take control" : `Take control from ${holder.name}`}
        </button>
      )}
    </section>
  );
}
