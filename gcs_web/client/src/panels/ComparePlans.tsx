/** Two trajectories beside each other: time, length, clearance and what each uses of its limits. */

import { effect, signal } from "@preact/signals";
import { number, sentenceCase } from "../format";
import { send } from "../socket";
import { connected, files, plan, verdict } from "../store";
import type { Limit, PlanSummary } from "../protocol";

/** Names; empty for the plan on the page. Null while nothing is compared. */
export const compared = signal<readonly [string, string] | null>(null);

const answer = signal<{ plans: readonly PlanSummary[]; error: string }>({ plans: [], error: "" });

effect(() => {
  const names = compared.value;
  const of = plan.value; // asked again once the plan, the map or the vehicle is another one
  if (names === null || of?.state === "planning") return;
  void send({ type: "compare_plans", names: [...names] }).then(({ plans, error }) => {
    if (compared.peek() === names) answer.value = { plans, error };
  });
});

export function ComparePlans() {
  const names = compared.value;
  if (names === null) return null;
  const { plans, error } = answer.value;
  const [a, b] = plans;
  return (
    <section class="block" aria-labelledby="compare-title">
      <div class="block-head">
        <h3 id="compare-title">Comparison</h3>
        <button type="button" class="link" onClick={() => (compared.value = null)}>
          Close
        </button>
      </div>
      <div class="compare-names">
        <Name label="First" value={names[0]} onChange={(name) => (compared.value = [name, names[1]])} />
        <Name label="Second" value={names[1]} onChange={(name) => (compared.value = [names[0], name])} />
      </div>
      {error !== "" && (
        <p class="danger-text" role="alert">
          {error}
        </p>
      )}
      {error === "" && a !== undefined && b !== undefined && <Table a={a} b={b} />}
    </section>
  );
}

function Name({ label, value, onChange }: { label: string; value: string; onChange: (name: string) => void }) {
  return (
    <span class="field-box">
      <select
        aria-label={`${label} trajectory`}
        value={value}
        disabled={!connected.value}
        onChange={(event) => onChange(event.currentTarget.value)}
      >
        {verdict.value === "checked" && <option value="">This plan</option>}
        {files.value.trajectories.map(({ name }) => (
          <option key={name} value={name}>
            {name}
          </option>
        ))}
      </select>
    </span>
  );
}

const FIGURES: readonly { name: string; unit: string; of: (summary: PlanSummary) => number }[] = [
  { name: "Time", unit: "s", of: (summary) => summary.duration_s },
  { name: "Length", unit: "m", of: (summary) => summary.length_m },
  { name: "Top speed", unit: "m/s", of: (summary) => summary.top_speed_m_s },
];

function Table({ a, b }: { a: PlanSummary; b: PlanSummary }) {
  const limits = [...new Set([...a.limits, ...b.limits].map(({ name }) => name))];
  return (
    <table class="table difference">
      <thead>
        <tr>
          <th scope="col" class="words">
            Now
          </th>
          <th scope="col">first</th>
          <th scope="col">second</th>
        </tr>
      </thead>
      <tbody>
        <tr class={a.passes === b.passes ? "" : "differs"}>
          <th scope="row" class="words">
            Gate
          </th>
          <td>{gateWords(a)}</td>
          <td>{gateWords(b)}</td>
        </tr>
        {FIGURES.map(({ name, unit, of }) => (
          <Row key={name} name={name} a={`${number(of(a), 2)} ${unit}`} b={`${number(of(b), 2)} ${unit}`} />
        ))}
        {limits.map((name) => (
          <Row key={name} name={sentenceCase(name)} a={limitWords(a, name)} b={limitWords(b, name)} />
        ))}
      </tbody>
    </table>
  );
}

function Row({ name, a, b }: { name: string; a: string; b: string }) {
  return (
    <tr class={a === b ? "" : "differs"}>
      <th scope="row" class="words">
        {name}
      </th>
      <td>{a}</td>
      <td>{b}</td>
    </tr>
  );
}

function gateWords({ passes, failures }: PlanSummary): string {
  return passes ? "passes" : `fails: ${failures.join(", ")}`;
}

function limitWords({ limits }: PlanSummary, name: string): string {
  const limit = limits.find((each: Limit) => each.name === name);
  if (limit === undefined) return "–";
  const { value, bound, sense, unit } = limit;
  return `${number(value, 2)} ${sense === "<=" ? "≤" : "≥"} ${number(bound, 2)} ${unit}`;
}
