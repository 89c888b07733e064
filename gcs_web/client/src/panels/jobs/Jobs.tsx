/** Background work of the station: what runs, waits and ended, and a form to start more. */

import { signal, useSignal } from "@preact/signals";
import { useEffect, useId, useRef } from "preact/hooks";
import "./jobs.css";
import { Said } from "../../components/Said";
import { parse, sentenceCase, span } from "../../core/format";
import { send, submit } from "../../core/socket";
import { connected, jobs } from "../../core/store";
import type { Job, JobField, JobKind, StartJob } from "../../core/protocol";

type Value = StartJob["arguments"][string];

/** Kind of the job whose form is open; null: none is. */
export const chosenKind = signal<string | null>(null);

/** A list of jobs; `kinds` are those that can be started here and are listed, all of them where it is left out. */
export function Jobs({ kinds }: { kinds?: readonly string[] }) {
  const offered = jobs.value.kinds.filter(({ name }) => kinds === undefined || kinds.includes(name));
  const open = offered.some(({ name }) => name === chosenKind.value);
  return (
    <section class="block" aria-labelledby="jobs-title">
      <div class="block-head">
        <h3 id="jobs-title">Jobs</h3>
        <span class="quiet">continue when the page is closed</span>
      </div>
      <JobRows {...(kinds === undefined ? {} : { kinds })} />
      {offered.length > 0 && !open && (
        <button
          type="button"
          class="control"
          disabled={!connected.value}
          onClick={() => {
            void submit({ type: "list_jobs" }); // files may have come since
            chosenKind.value = offered[0]?.name ?? null;
          }}
        >
          New job
        </button>
      )}
      {open && <JobForm kinds={offered} onDone={() => (chosenKind.value = null)} />}
    </section>
  );
}

const ORDER = { running: 0, waiting: 1, done: 2, failed: 2, cancelled: 2 } as const;

const CLOSED: readonly Job["state"][] = ["done", "cancelled"];

/** What runs, then what waits in the order of the queue, then what ended, the newest first. */
function inOrder(a: Job, b: Job): number {
  return ORDER[a.state] - ORDER[b.state] || (ORDER[a.state] < 2 ? a.id - b.id : b.id - a.id);
}

/** Jobs of these kinds (all: left out); if wished, only those that run, wait or failed. */
export function JobRows({ kinds, open = false }: { kinds?: readonly string[]; open?: boolean }) {
  const shown = jobs.value.jobs
    .filter(({ kind, state }) => (kinds === undefined || kinds.includes(kind)) && (!open || !CLOSED.includes(state)))
    .sort(inOrder);
  if (open && shown.length === 0) return null;
  if (shown.length === 0) return <p class="quiet">Nothing is running and nothing waits.</p>;
  return (
    <ul class="jobs">
      {shown.map((job) => (
        <JobRow key={job.id} job={job} />
      ))}
    </ul>
  );
}

function JobRow({ job }: { job: Job }) {
  const isOpen = job.state === "running" || job.state === "waiting";
  return (
    <li class={`job ${job.state}`}>
      <div class="block-head">
        <b>{job.title}</b>
        <span class="quiet">{stateWords(job)}</span>
      </div>
      <div
        class="job-bar"
        role="progressbar"
        aria-label={`${job.title}: ${job.stage}`}
        aria-valuenow={Math.round(100 * job.share)}
      >
        <span style={{ width: `${100 * job.share}%` }} />
      </div>
      <div class="block-head">
        <span class={job.state === "failed" ? "danger-text" : "quiet"}>
          <Said text={detail(job)} />
        </span>
        <button
          type="button"
          class="link"
          disabled={!connected.value}
          aria-label={`${isOpen ? "Cancel" : "Remove from the list"}: ${job.title}`}
          onClick={() => void submit(isOpen ? { type: "cancel_job", job: job.id } : { type: "forget_job", job: job.id })}
        >
          {isOpen ? "Cancel" : "Remove"}
        </button>
      </div>
    </li>
  );
}

function stateWords({ state, elapsed_s, left_s }: Job): string {
  if (state === "waiting") return "waiting";
  if (state !== "running") return `${state} after ${span(elapsed_s)}`;
  return left_s === null ? `running ${span(elapsed_s)}` : `step: ${span(left_s)} left`;
}

function detail({ state, stage, share, words, author }: Job): string {
  if (state === "waiting") return `after the one above; started by ${author}`;
  if (state === "running") return `${stage}, ${Math.round(100 * share)} %`;
  return sentenceCase(words);
}

// --- starting one ---

const ASKED_AFTER_MS = 300;

interface JobFormProps {
  kinds: readonly JobKind[];
  /** In the place of the kind's defaults. */
  first?: Readonly<Record<string, Value>>;
  onDone: () => void;
}

/** Of the kind that is chosen, among these. */
export function JobForm({ kinds, first = {}, onDone }: JobFormProps) {
  const given = useSignal<Readonly<Record<string, Value>>>(first);
  const refusal = useSignal("");
  const foreseen = useSignal("");
  const form = useRef<HTMLFormElement>(null);
  const id = useId();
  const kind = kinds.find((each) => each.name === chosenKind.value);
  const fields = kind?.fields.map((field): [string, Value] => [field.name, given.value[field.name] ?? field.default]);
  const wanted = JSON.stringify([kind?.name, fields]);
  useEffect(() => form.current?.scrollIntoView({ block: "nearest" }), [kind?.name]);
  useEffect(() => {
    foreseen.value = "";
    if (kind === undefined || fields === undefined) return undefined;
    let current = true;
    const ask = setTimeout(async () => {
      const { words, error } = await send({ type: "foresee_job", kind: kind.name, arguments: Object.fromEntries(fields) });
      if (current) foreseen.value = words || error;
    }, ASKED_AFTER_MS);
    return () => {
      current = false;
      clearTimeout(ask);
    };
  }, [wanted]);
  if (kind === undefined) return null;
  const lacking = kind.fields.find(({ form, choices }) => (form === "choice" || form === "several") && !choices.length);
  const start = async (): Promise<void> => {
    const reply = await send({ type: "start_job", kind: kind.name, arguments: Object.fromEntries(fields ?? []) });
    refusal.value = reply.error;
    if (reply.error === "") onDone();
  };
  return (
    <form
      ref={form}
      class="job-form"
      aria-label={kinds.length === 1 ? kind.title : "New job"}
      onSubmit={(event) => {
        event.preventDefault();
        void start();
      }}
    >
      {kinds.length > 1 && (
        <div class="field long">
          <label for={id}>Job</label>
          <span class="field-box">
            <select
              id={id}
              value={kind.name}
              onChange={(event) => {
                chosenKind.value = event.currentTarget.value;
                given.value = {};
                refusal.value = "";
              }}
            >
              {kinds.map((each) => (
                <option key={each.name} value={each.name}>
                  {each.title}
                </option>
              ))}
            </select>
          </span>
        </div>
      )}
      {kind.fields.map((field) => (
        <FieldOf
          key={`${kind.name}.${field.name}`}
          field={field}
          value={given.value[field.name] ?? field.default}
          onChange={(value) => (given.value = { ...given.value, [field.name]: value })}
        />
      ))}
      {lacking !== undefined && (
        <p class="quiet">
          {lacking.title}: the project has none. {lacking.says}
        </p>
      )}
      {foreseen.value !== "" && (
        <p class="quiet" role="status">
          <Said text={sentenceCase(foreseen.value)} />
        </p>
      )}
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          <Said text={sentenceCase(refusal.value)} />
        </p>
      )}
      <div class="acts-row">
        <button type="button" class="control" onClick={onDone}>
          Close
        </button>
        <button type="submit" class="control grow" disabled={!connected.value || lacking !== undefined}>
          Start
        </button>
      </div>
    </form>
  );
}

interface FieldProps {
  field: JobField;
  value: Value;
  onChange: (value: Value) => void;
}

function FieldOf({ field, value, onChange }: FieldProps) {
  const id = useId();
  if (field.form === "flag") {
    return (
      <label class="switch">
        <input type="checkbox" checked={value === true} onChange={(event) => onChange(event.currentTarget.checked)} />
        {field.title}
      </label>
    );
  }
  if (field.form === "several") return <Several field={field} value={value} onChange={onChange} />;
  return (
    <div class="field long">
      <label for={id} title={field.says}>
        {field.title}
      </label>
      <span class="field-box">
        {field.form === "choice" ? (
          <select id={id} value={String(value)} onChange={(event) => onChange(event.currentTarget.value)}>
            {field.choices.map((choice) => (
              <option key={choice} value={choice}>
                {choice || "none"}
              </option>
            ))}
          </select>
        ) : (
          <input
            id={id}
            value={String(value)}
            inputMode={field.form === "text" ? "text" : "decimal"}
            onInput={(event) => {
              const { value: text } = event.currentTarget;
              onChange(field.form === "text" ? text : (parse(text) ?? text)); // the server refuses what is no number
            }}
          />
        )}
        {field.unit !== "" && <span class="unit">{field.unit}</span>}
      </span>
    </div>
  );
}

function Several({ field, value, onChange }: FieldProps) {
  const chosen = Array.isArray(value) ? value : [];
  return (
    <fieldset class="several">
      <legend>{field.title}</legend>
      {field.choices.map((choice) => (
        <label key={choice} class="switch">
          <input
            type="checkbox"
            checked={chosen.includes(choice)}
            onChange={(event) =>
              onChange(event.currentTarget.checked ? [...chosen, choice] : chosen.filter((each) => each !== choice))
            }
          />
          {choice}
        </label>
      ))}
    </fieldset>
  );
}

/** In the status bar: how many run and wait, and how far the running one is. */
export function JobChip({ onClick }: { onClick: () => void }) {
  const running = jobs.value.jobs.find(({ state }) => state === "running");
  const waiting = jobs.value.jobs.filter(({ state }) => state === "waiting").length;
  if (!connected.value || (running === undefined && waiting === 0)) return null;
  const words = running === undefined ? "" : `1 running, ${Math.round(100 * running.share)} %`;
  return (
    <button type="button" class="plain job-chip" title={running?.title ?? ""} onClick={onClick}>
      Jobs: {[words, waiting > 0 ? `${waiting} waiting` : ""].filter((part) => part !== "").join(", ")}
    </button>
  );
}
