/** The verdict on the plan in a badge and a sentence, and the way out where there is one. */

import { Badge } from "../../components/Badge";
import type { Tone } from "../../components/Badge";
import { Icon } from "../../components/Icon";
import { Said } from "../../components/Said";
import { MapButtons, VehicleButtons } from "../start/Buttons";
import { select } from "../timeline/cursor";
import { submit } from "../../core/socket";
import { connected, doc, draft, files, plan, verdict } from "../../core/store";

type State = typeof verdict.value;
/** Of a draft that is no flight. */
const DRAFT_TONES = { clear: "accent", "too close": "caution", refused: "danger", checked: "accent" } as const;

const BADGES: Readonly<Record<State, { tone: Tone; word: string }>> = {
  none: { tone: "neutral", word: "No plan" },
  planning: { tone: "accent", word: "Planning" },
  checked: { tone: "neutral", word: "Checked" },
  draft: { tone: "accent", word: "Draft" },
  refused: { tone: "danger", word: "Refused" },
  void: { tone: "caution", word: "Void" },
  unknown: { tone: "caution", word: "Not connected" },
};

export function Verdict() {
  const state = verdict.value;
  const { word } = BADGES[state];
  const foreseen = state === "draft" ? draft.value : null;
  const tone = foreseen === null ? BADGES[state].tone : DRAFT_TONES[foreseen.state];
  const shown = plan.value;
  return (
    <section class={`verdict ${state}`} aria-label="Verdict">
      <div class="block-head">
        <h2>{shown?.name ? shown.name : "Plan"}</h2>
        <Badge tone={tone}>
          {state === "checked" && <Icon name="check" />}
          {(tone === "danger" || state === "void" || foreseen?.state === "too close") && <Icon name="warning" />}
          {word}
        </Badge>
      </div>
      <p>
        <Said text={(foreseen ?? shown)?.sentence ?? "No plan yet. Two waypoints make the first one."} />
      </p>
      {state === "none" && <Lacking />}
      {state === "refused" && <Remedy />}
      {state === "void" && (
        <button type="button" class="control" onClick={() => void submit({ type: "plan_again" })}>
          Plan and check again
        </button>
      )}
    </section>
  );
}

/** What no plan can be made without, where the project has none. */
function Lacking() {
  const { has_map, has_vehicle } = files.value;
  if (has_map && has_vehicle) return null;
  return <div class="fill">{has_map ? <VehicleButtons /> : <MapButtons />}</div>;
}

function Remedy() {
  const problem = plan.value?.problem ?? null;
  if (problem === null) return null;
  const { waypoint } = problem;
  const index = (doc.value?.waypoints ?? []).findIndex(({ id }) => id === waypoint);
  return (
    <>
      {problem.reason !== plan.value?.sentence && <p class="danger-text"><Said text={problem.reason} /></p>}
      {problem.remedy !== "" && (
        <p>
          <Said text={problem.remedy} />
        </p>
      )}
      {index >= 0 && waypoint !== null && (
        <button type="button" class="control" disabled={!connected.value} onClick={() => select([waypoint])}>
          Go to waypoint {index + 1}
        </button>
      )}
    </>
  );
}
