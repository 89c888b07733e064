/** Two trajectories beside each other: time, length, clearance and what each uses of its limits. */

import { TableHead } from "../../components/TableHead";
import { effect, signal } from "@preact/signals";
import { number, sentenceCase } from "../../core/format";
import { send } from "../../core/socket";
import { connected, files, plan, verdict } from "../../core/store";
import type { Limit, PlanSummary } from "../../core/protocol";

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

const FIGURES: readonly { name: string; of: (summary: PlanSummary) => number }[] = [
  { name: "Time, s", of: (summary) => summary.duration_s },
  { name: "Length, m", of: (summary) => summary.length_m },
  { name: "Top speed, m/s", of: (summary) => summary.top_speed_m_s },
];

function Table({ a, b }: { a: PlanSummary; b: PlanSummary }) {
  const names = [...new Set([...a.limits, ...b.limits].map(({ name }) => name))];
  return (
    <table class="table difference">
      <TableHead columns={["As map and vehicle are now", "first", "second"]} words={["As map and vehicle are now"]} />
      <tbody>
        <Row name="Gate" a={gateWords(a)} b={gateWords(b)} />
        {FIGURES.map(({ name, of }) => (
          <Row key={name} name={name} a={number(of(a), 2)} b={number(of(b), 2)} />
        ))}
        {names.map((name) => (
          <LimitRow key={name} a={limitOf(a, name)} b={limitOf(b, name)} />
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

/** The bound stands with the name where both have the same one, else with each value. */
function LimitRow({ a, b }: { a: Limit | undefined; b: Limit | undefined }) {
  const any = a ?? b;
  if (any === undefined) return null;
  const isShared = a === undefined || b === undefined || boundWords(a) === boundWords(b);
  const words = (limit: Limit | undefined): string =>
    limit === undefined ? "–" : `${number(limit.value, 2)}${isShared ? "" : ` ${boundWords(limit)}`}`;
  const name = `${sentenceCase(any.name)}${isShared ? ` ${boundWords(any)}` : ","} ${any.unit}`;
  return <Row name={name} a={words(a)} b={words(b)} />;
}

function gateWords({ passes, failures }: PlanSummary): string {
  return passes ? "passes" : `fails: ${failures.join(", ")}`;
}

function limitOf({ limits }: PlanSummary, name: string): Limit | undefined {
  return limits.find((each) => each.name === name);
}

function boundWords({ sense, bound }: Limit): string {
  return `${sense === "<=" ? "≤" : "≥"} ${number(bound, 2)}`;
}
