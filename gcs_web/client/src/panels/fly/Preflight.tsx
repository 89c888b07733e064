/** The plan flown many times in simulation: what came of it, on Plan and in the list before a flight, and its start. */

import { computed } from "@preact/signals";
import { Badge } from "../../components/Badge";
import type { Tone } from "../../components/Badge";
import { Icon } from "../../components/Icon";
import { Said } from "../../components/Said";
import { number, sentenceCase } from "../../core/format";
import { send } from "../../core/socket";
import { announce, connected, foreign, isNoGo, jobs, preflight, vehicle } from "../../core/store";
import type { Preflight } from "../../core/protocol";
import { JobForm, JobRows, chosenKind } from "../jobs/Jobs";

const KIND = "preflight";

const kind = computed(() => jobs.value.kinds.find(({ name }) => name === KIND) ?? null);
const isRunning = computed(() =>
  jobs.value.jobs.some((job) => job.kind === KIND && (job.state === "running" || job.state === "waiting")),
);

/** Whether the checked plan's own preflight is a go. */
export const isFlownInSimulation = computed(() => preflight.value?.state === "current" && preflight.value.verdict === "go");

/** As the last one was asked for. */
const asked = computed(() => preflight.value?.asked ?? {});

/** Its flights leave the verdict open: the same ones again would, too, and the first of more are the same. */
const isNotShown = computed(() => preflight.value?.state === "current" && preflight.value.verdict === "not_shown");

async function start(): Promise<void> {
  const { error } = await send({ type: "start_job", kind: KIND, arguments: asked.value });
  if (error !== "") announce(error, "danger");
}

/** What the form begins with: where the verdict is open, four times as many flights. */
const proposed = computed(() =>
  isNotShown.value ? { ...asked.value, flights: 4 * (preflight.value?.flights ?? 0) } : asked.value,
);

const WORDS = { go: "Go", no_go: "No-go", not_shown: "Not shown" } as const;

function badge({ state, verdict: found }: Preflight): { tone: Tone; word: string } {
  if (state === "stale" && found === "no_go") return { tone: "danger", word: "No-go, stale" };
  if (state !== "current") return { tone: "caution", word: state === "none" ? "Not flown" : "Stale" };
  return { tone: found === "go" ? "neutral" : found === "no_go" ? "danger" : "caution", word: WORDS[found] };
}

function finding({ state, stale, verdict: found, sentence }: Preflight): string {
  if (state === "none") return "Not flown yet.";
  if (state === "current") return sentence;
  const what = stale === "the plan" ? "Flown for another plan" : `${sentenceCase(stale)} changed since it was flown`;
  return `${what}: ${WORDS[found].toLowerCase()}.`;
}

/** On the step Plan, below the verdict. */
export function PreflightBlock() {
  const found = preflight.value;
  if (found === null) return null;
  const { tone, word } = badge(found);
  return (
    <section class="block" aria-label="Preflight">
      <div class="block-head">
        <h3>Preflight</h3>
        <Badge tone={tone}>
          {isFlownInSimulation.value && <Icon name="check" />}
          {tone === "danger" && <Icon name="warning" />}
          {word}
        </Badge>
      </div>
      <p>
        <Said text={finding(found)} />
      </p>
      {found.state === "current" && <Why found={found} />}
      <Begin name={found.state === "none" ? "Fly it in simulation" : "Fly it again"} />
    </section>
  );
}

function Why({ found: { decides, remedy, assumed } }: { found: Preflight }) {
  return (
    <>
      {decides !== "" && (
        <p class="quiet">
          <Said text={`Decides most: ${decides}.`} />
        </p>
      )}
      {remedy !== "" && (
        <p class="quiet">
          <Said text={`${sentenceCase(remedy)}.`} />
        </p>
      )}
      {assumed.length > 0 && (
        <details>
          <summary>Assumed, or not counted</summary>
          <ul>
            {assumed.map((each) => (
              <li key={each} class="quiet">
                <Said text={`${sentenceCase(each)}.`} />
              </li>
            ))}
          </ul>
        </details>
      )}
    </>
  );
}

/** Starts it as the last one was asked for, or opens the form of others; how far it is. */
function Begin({ name }: { name: string }) {
  if (kind.value === null) return null;
  if (chosenKind.value === KIND) {
    return <JobForm kinds={[kind.value]} first={proposed.value} onDone={() => (chosenKind.value = null)} />;
  }
  return (
    <>
      <JobRows kinds={[KIND]} open />
      {!isRunning.value && (
        <div class="acts-row">
          {!isNotShown.value && (
            <button type="button" class="control grow" disabled={!connected.value} onClick={() => void start()}>
              {name}
            </button>
          )}
          <button type="button" class="control" disabled={!connected.value} onClick={() => (chosenKind.value = KIND)}>
            {isNotShown.value ? "Fly more" : "Wind and risk"}
          </button>
        </div>
      )}
    </>
  );
}

/** What the vehicle does not tell on the ground, which keeps nothing from being flown. */
export function NotTold() {
  const found = preflight.value;
  const flown = found?.state === "current" ? `; the preflight was flown for ${number(found.wind_m_s, 1)} m/s` : "";
  const isTold = vehicle.value?.checks.some(({ name }) => name === "remote control") ?? false;
  const remote = foreign.value === null ? "not told: Goshawk's link has no sticks" : "not told: look at the transmitter";
  return (
    <>
      <li class="quiet">
        <Icon name="unknown" />
        <span>
          <b>Wind</b> not told on the ground: the observer measures it in flight{flown}.
        </span>
      </li>
      {!isTold && (
        <li class="quiet">
          <Icon name="unknown" />
          <span>
            <b>Remote control</b> {remote}.
          </span>
        </li>
      )}
    </>
  );
}

/** In the list before a flight: a no-go forbids it, one that was not flown does not. */
export function PreflightLine() {
  const found = preflight.value;
  if (found === null) {
    return (
      <li class="caution-text">
        <Icon name="warning" />
        <span class="visually-hidden">caution</span>
        <span>
          <b>Preflight</b> There is no checked plan to fly in simulation.
        </span>
      </li>
    );
  }
  const passed = isFlownInSimulation.value;
  return (
    <li class={passed ? "" : badge(found).tone === "danger" ? "danger-text" : "caution-text"}>
      <Icon name={passed ? "check" : "warning"} />
      <span class="visually-hidden">{passed ? "passed" : isNoGo.value ? "failed" : "caution"}</span>
      <span>
        <b>Preflight</b> {passed ? "Go. " : isNoGo.value ? "No-go. " : ""}
        <Said text={finding(found)} />
        {foreign.value !== null && found.state === "current" && " Flown by Goshawk's own controller."}
        {isNoGo.value && (
          <span class="remedy">
            <Said text={`${sentenceCase(found.remedy || "give the plan more room, or fly slower")}.`} />
          </span>
        )}
        {!passed && <Begin name={found.state === "none" ? "Fly it in simulation" : "Fly it again"} />}
      </span>
    </li>
  );
}
