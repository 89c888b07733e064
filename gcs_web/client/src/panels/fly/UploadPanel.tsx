/** The plan against what the vehicle holds, and the button that is held to send it. */

import { confirmUpload, prepareUpload, uploading } from "./orders";
import type { UploadState } from "./orders";
import { Badge } from "../../components/Badge";
import { HoldButton } from "../../components/HoldButton";
import { Said } from "../../components/Said";
import { TableHead } from "../../components/TableHead";
import { checksum, number } from "../../core/format";
import { connected, inControl, plan, verdict } from "../../core/store";
import type { Held } from "../../core/protocol";
import { Control } from "./Control";

const ROWS: readonly { name: string; of: (held: Held) => string }[] = [
  { name: "Name", of: (held) => held.name },
  { name: "Duration", of: (held) => `${number(held.duration_s, 2)} s` },
  { name: "Segments", of: (held) => String(held.segments) },
  { name: "Room for error", of: (held) => `${number(held.room_m, 2)} m` },
  { name: "Checksum", of: (held) => checksum(held.crc32) },
];

export function UploadPanel({ state }: { state: UploadState }) {
  const prepared = state.stage === "prepared" ? state.reply : null;
  const here = prepared?.here ?? null;
  const there = prepared?.there ?? null;
  const isCurrent = verdict.value === "checked" && here !== null && here.crc32 === plan.value?.crc32;
  return (
    <>
      <section class="verdict">
        <div class="block-head">
          <h2>Upload {here?.name ?? plan.value?.name ?? ""}</h2>
          {prepared !== null && <Badge>{differences(here, there)}</Badge>}
        </div>
        <p class={state.stage === "refused" ? "danger-text" : ""}><Said text={sentence(state, there)} /></p>
      </section>
      {prepared !== null && <Difference here={here} there={there} />}
      <div class="spring" />
      {!inControl.value && <Control />}
      <div class="acts column">
        {isCurrent && prepared !== null && (
          <>
            <HoldButton
              act={`upload ${here.name}`}
              primary
              disabled={!connected.value || !inControl.value}
              onHeld={() => void confirmUpload(prepared.nonce)}
            />
            <p class="quiet centred">Let go to cancel. Nothing is sent before the bar is full.</p>
          </>
        )}
        {(state.stage === "refused" || (prepared !== null && !isCurrent)) && (
          <button
            type="button"
            class="control primary"
            disabled={verdict.value !== "checked" || !inControl.value}
            onClick={() => void prepareUpload()}
          >
            Compare again
          </button>
        )}
        <button
          type="button"
          class="control"
          disabled={state.stage === "sending"}
          onClick={() => (uploading.value = null)}
        >
          Back
        </button>
      </div>
    </>
  );
}

function sentence(state: UploadState, there: Held | null): string {
  switch (state.stage) {
    case "control":
      return "Take control to compare the plan with what the vehicle holds.";
    case "comparing":
      return "Reading what the vehicle holds.";
    case "sending":
      return "Sending the plan and reading it back.";
    case "refused":
      return state.error;
    case "prepared":
      if (there === null) return "The vehicle holds no trajectory. Nothing moves until the start order.";
      return `Replaces ${there.name} on the vehicle. Nothing moves until the start order.`;
  }
}

function differences(here: Held | null, there: Held | null): string {
  if (here === null || there === null) return "New";
  const count = ROWS.filter(({ of }) => of(here) !== of(there)).length;
  return count === 0 ? "Equal" : `Differs in ${count} of ${ROWS.length}`;
}

function Difference({ here, there }: { here: Held | null; there: Held | null }) {
  return (
    <table class="table difference">
      <TableHead columns={["Difference", "vehicle", "plan"]} words={["Difference"]} />
      <tbody>
        {ROWS.map(({ name, of }) => {
          const [theirs, ours] = [there === null ? "–" : of(there), here === null ? "–" : of(here)];
          return (
            <tr key={name} class={theirs === ours ? "" : "differs"}>
              <th scope="row" class="words">
                {name}
              </th>
              <td>{theirs}</td>
              <td>{ours}</td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
