/** The controller's compensation: what the vehicle flies with against the kept model, and the button that is held to send it. */

import { signal } from "@preact/signals";
import { Badge } from "../../components/Badge";
import { HoldButton } from "../../components/HoldButton";
import { TableHead } from "../../components/TableHead";
import { number, plural } from "../../core/format";
import { send } from "../../core/socket";
import { connected, hasVehicle, inControl, model, vehicle } from "../../core/store";
import type { Compensation as Compared, ControllerParameter, NotCompensated, Reply } from "../../core/protocol";
import { Control } from "./Control";

/** `compared` has the nonce that lets this difference through; sending uses it up, whatever the answer. */
type State =
  | { stage: "closed" | "reading" | "sending" }
  | { stage: "refused"; error: string }
  | { stage: "compared" | "sent"; found: Compared; nonce: string };

const state = signal<State>({ stage: "closed" });
const equalToo = signal(false);
/** The mark of the model that the pilot has accepted. */
const acceptedMark = signal("");

async function compare(): Promise<void> {
  acceptedMark.value = "";
  state.value = { stage: "reading" };
  take(await send({ type: "prepare_compensation" }), "compared");
}

async function confirm(nonce: string): Promise<void> {
  state.value = { stage: "sending" };
  take(await send({ type: "send_compensation", nonce, accepted_mark: acceptedMark.value }), "sent");
}

function take({ error, compensation, nonce }: Reply, stage: "compared" | "sent"): void {
  if (error !== "" || compensation === null) state.value = { stage: "refused", error };
  else state.value = { stage, found: compensation, nonce };
}

export function Compensation() {
  if (!hasVehicle.value) return null;
  const now = state.value;
  const found = "found" in now ? now.found : null;
  const differing = found?.parameters.filter((row) => row.flies_with !== row.model) ?? [];
  const version = model.value?.versions.find(({ current }) => current)?.number ?? 0;
  const mayCompensate = found !== null && (found.mark === "" || found.mark === acceptedMark.value);
  const isOld = found !== null && found.version !== version;
  return (
    <section class="block" aria-labelledby="compensation-title">
      <div class="block-head">
        <h2 id="compensation-title">Controller's compensation</h2>
        {found !== null && <Badge>{differing.length === 0 ? "Equal" : `Differs in ${differing.length}`}</Badge>}
      </div>
      <p class={now.stage === "refused" ? "danger-text" : "dim"} role="status">
        {sentence(now, differing.length)}
      </p>
      {isOld && <p class="caution-text">The vehicle file is at version {version} now. Compare again.</p>}
      {found !== null && <Difference rows={equalToo.value ? found.parameters : differing} found={found} />}
      {found !== null && <NotCompensatedList effects={found.not_compensated} />}
      {!inControl.value && <Control />}
      {now.stage === "compared" && differing.length > 0 && !isOld && (
        <>
          {vehicle.value?.armed === true && differing.some(({ in_flight }) => !in_flight) && (
            <p class="caution-text">The vehicle is armed; most of these can be changed only while it is disarmed.</p>
          )}
          {now.found.mark !== "" && (
            <label class="caution-text">
              <input
                type="checkbox"
                checked={acceptedMark.value === now.found.mark}
                onChange={(event) => (acceptedMark.value = event.currentTarget.checked ? now.found.mark : "")}
              />{" "}
              The model is {now.found.mark}. Compensate by it all the same.
            </label>
          )}
          <HoldButton
            act={`set ${plural(differing.length, "parameter", "parameters")}`}
            disabled={!connected.value || !inControl.value || !mayCompensate}
            onHeld={() => void confirm(now.nonce)}
          />
        </>
      )}
      <button
        type="button"
        class="control"
        disabled={!connected.value || !inControl.value || now.stage === "reading" || now.stage === "sending"}
        onClick={() => void compare()}
      >
        {now.stage === "closed" ? "Compare with the vehicle" : "Compare again"}
      </button>
    </section>
  );
}

function sentence(now: State, differing: number): string {
  switch (now.stage) {
    case "closed":
      return "What the vehicle flies with against the model kept here. Take control to compare them.";
    case "reading":
      return "Reading the controller's parameters.";
    case "sending":
      return "Sending the parameters as one block and reading them back.";
    case "refused":
      return now.error;
    case "compared":
      return differing === 0
        ? "The vehicle flies with this model."
        : "Sent as one block with a checksum: the vehicle takes all of it or nothing. Gains stay as they are.";
    case "sent":
      return "Set, read back and equal: the vehicle flies with this model.";
  }
}

/** With all the digits of a float32, so that two that differ look different. */
function exact(value: number): string {
  const size = Math.abs(value);
  return size === 0 || (size >= 1e-3 && size < 1e5) ? String(value).replace("-", "−") : scientific(value);
}

function scientific(value: number): string {
  const [digits = "", power = "0"] = value.toExponential().replace("-", "−").split("e");
  return `${digits}e${power.replace("+", "")}`;
}

function Difference({ rows, found }: { rows: readonly ControllerParameter[]; found: Compared }) {
  const equal = found.parameters.filter((row) => row.flies_with === row.model).length;
  return (
    <>
      {rows.length > 0 && (
        <div class="table-scroll">
          <table class="table compensation">
            <TableHead columns={["parameter", "vehicle", "model", "change", "unit"]} words={["parameter", "unit"]} />
            <tbody>
              {rows.map((row) => (
                <tr key={row.name} class={row.flies_with === row.model ? "" : "touched"}>
                  <th scope="row" class="words">
                    {row.name}
                  </th>
                  <td>{exact(row.flies_with)}</td>
                  <td>{exact(row.model)}</td>
                  <td>{changeOf(row)}</td>
                  <td class="words">{row.unit === "1" ? "" : row.unit}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {equal > 0 && (
        <button type="button" class="link small" onClick={() => (equalToo.value = !equalToo.value)}>
          {equalToo.value ? "Show those that differ" : `Show ${equal} that are equal`}
        </button>
      )}
    </>
  );
}

function changeOf({ flies_with, model: wanted }: ControllerParameter): string {
  if (flies_with === wanted) return "";
  if (flies_with === 0) return "new";
  const percent = (100 * (wanted - flies_with)) / Math.abs(flies_with);
  return `${percent > 0 ? "+" : ""}${number(percent, Math.abs(percent) < 10 ? 1 : 0)} %`;
}

function NotCompensatedList({ effects }: { effects: readonly NotCompensated[] }) {
  if (effects.length === 0) return null;
  return (
    <details>
      <summary>{plural(effects.length, "effect", "effects")} of the model that the controller does not cancel</summary>
      <ul>
        {effects.map(({ title, why }) => (
          <li key={title} class="quiet">
            {title}: {why}
          </li>
        ))}
      </ul>
    </details>
  );
}
