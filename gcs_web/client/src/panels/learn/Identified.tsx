/** The newest identification: values before and after, correlation of the estimates, every parameter over the trials. */

import { useSignal } from "@preact/signals";
import { Badge } from "../../components/Badge";
import { Said } from "../../components/Said";
import { TableHead } from "../../components/TableHead";
import { number, plural, sentenceCase } from "../../core/format";
import { identification } from "../../core/store";
import type { Identification, Identified as Row, Trial } from "../../core/protocol";
import { Jobs } from "../jobs/Jobs";
import { figure } from "./Learn";

export function Identified() {
  const found = identification.value;
  return (
    <>
      <Jobs kinds={["identify"]} />
      {found !== null && found.state !== "none" && <Found found={found} />}
    </>
  );
}

function Found({ found }: { found: Identification }) {
  return (
    <section class="block" aria-labelledby="identified-title">
      <div class="block-head">
        <h2 id="identified-title">Identified</h2>
        <Badge>{found.verdict}</Badge>
      </div>
      <p class="dim">
        {plural(found.free.length, "parameter", "parameters")} fitted to {found.flights.join(", ")}.
        {found.written.length > 0 && ` Written: ${found.written.join(", ")}.`}
      </p>
      {found.state === "old" && <p class="caution-text">The vehicle file or a flight changed since.</p>}
      {found.reasons.map((reason) => (
        <p key={reason} class="caution-text">
          <Said text={sentenceCase(reason)} />
        </p>
      ))}
      <Values rows={found.parameters} />
      <Correlation found={found} />
      {found.trials.length > 0 && <Trials found={found} />}
    </section>
  );
}

function Values({ rows }: { rows: readonly Row[] }) {
  const free = rows.filter(({ status }) => status === "free");
  const held = rows.filter(({ status }) => status !== "free");
  return (
    <>
      <div class="table-scroll">
        <table class="table compensation">
          <TableHead columns={["parameter", "before", "after", "± σ", "unit"]} words={["parameter", "unit"]} />
          <tbody>
            {free.map(({ name, words, unit, start, value, sigma }) => (
              <tr key={name}>
                <th scope="row" class="words" title={name}>
                  {words}
                </th>
                <td>{figure(start)}</td>
                <td>{figure(value)}</td>
                <td>{figure(sigma)}</td>
                <td class="words">{unit === "1" ? "" : unit}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {held.length > 0 && (
        <details>
          <summary>{held.length} held</summary>
          <ul>
            {held.map(({ name, words, status }) => (
              <li key={name} class="quiet">
                {words} ({name}): {status}
              </li>
            ))}
          </ul>
        </details>
      )}
    </>
  );
}

/** The free parameters in the order of the correlation matrix and of the trials. */
function rowsOfFree(found: Identification): Row[] {
  const rows = new Map(found.parameters.map((row) => [row.name, row]));
  return found.free.flatMap((name) => rows.get(name) ?? []);
}

const MOST_NAMED = 5;

function Correlation({ found }: { found: Identification }) {
  const { correlation, confounded } = found;
  const free = rowsOfFree(found).map(({ words }) => words);
  const at = useSignal<readonly [number, number] | null>(null);
  const [row, column] = at.value ?? [0, 0];
  return (
    <>
      <h3>Correlation of the estimates</h3>
      <div
        class="correlation"
        role="img"
        aria-label={`Correlation of ${free.length} parameters; strongest: ${confounded
          .slice(0, MOST_NAMED)
          .map(({ first, second, correlation: r }) => `${first} and ${second} ${number(r, 2)}`)
          .join(", ") || "none of 0.9 or more"}`}
        style={{ "--side": free.length }}
        onPointerLeave={() => (at.value = null)}
      >
        {correlation.flatMap((values, i) =>
          values.map((r, j) => (
            <span
              key={`${i} ${j}`}
              class={r < 0 ? "negative" : "positive"}
              style={{ "--share": `${Math.round(100 * Math.abs(r))}%` }}
              onPointerEnter={() => (at.value = [i, j])}
            />
          )),
        )}
      </div>
      <p class="quiet">
        {at.value === null
          ? "Blue: rise together; orange: one rises as the other falls. Point at a cell for its pair."
          : `${free[row] ?? ""} and ${free[column] ?? ""}: ${number(correlation[row]?.[column], 2)}`}
      </p>
      {confounded.length === 0 ? (
        <p class="quiet">No two of them are confounded (0.9 or more).</p>
      ) : (
        <ul>
          {confounded.slice(0, MOST_NAMED).map(({ first, second, correlation: r }) => (
            <li key={`${first} ${second}`} class="caution-text">
              {first} and {second} are confounded: {number(r, 3)}
            </li>
          ))}
          {confounded.length > MOST_NAMED && <li class="quiet">{confounded.length - MOST_NAMED} more pairs</li>}
        </ul>
      )}
    </>
  );
}

/** Each parameter over the trials, with bars of one standard error (Rigter et al., Fig. 8). */
function Trials({ found }: { found: Identification }) {
  return (
    <>
      <h3>Over the trials</h3>
      <p class="quiet">Each flight fitted alone; bars one standard error, dashed the mean, in the table's units.</p>
      <div class="trials">
        {rowsOfFree(found).map(({ name, words, unit }, k) => (
          <TrialPlot key={name} words={words} unit={unit} trials={found.trials} k={k} />
        ))}
      </div>
    </>
  );
}

const WIDTH = 170;
const HEIGHT = 84;
const EDGE = 10;

function TrialPlot({ words, unit, trials, k }: { words: string; unit: string; trials: readonly Trial[]; k: number }) {
  const points = trials.map(({ flight, values, sigmas }) => ({ flight, value: values[k] ?? 0, sigma: sigmas[k] ?? 0 }));
  const low = Math.min(...points.map(({ value, sigma }) => value - sigma));
  const high = Math.max(...points.map(({ value, sigma }) => value + sigma));
  const span = high - low || Math.max(Math.abs(high), 1e-12);
  const mean = points.reduce((sum, { value }) => sum + value, 0) / points.length;
  const y = (value: number): number => HEIGHT - EDGE - ((HEIGHT - 2 * EDGE) * (value - low)) / span;
  const said = points.map(({ flight, value, sigma }) => `${flight} ${figure(value)} ± ${figure(sigma)}`).join(", ");
  return (
    <figure>
      <figcaption class="quiet">
        {words}
        {unit !== "1" && unit !== "" && `, ${unit}`}: {figure(mean)}
      </figcaption>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={`${words} over the trials: ${said}`}>
        <line class="trial-mean" x1="0" x2={WIDTH} y1={y(mean)} y2={y(mean)} />
        {points.map(({ flight, value, sigma }, i) => {
          const x = ((i + 0.5) * WIDTH) / points.length;
          return (
            <g key={flight} class={sigma === 0 ? "unknown" : ""}>
              <title>{`${flight}: ${figure(value)} ± ${figure(sigma)}`}</title>
              <line x1={x} x2={x} y1={y(value - sigma)} y2={y(value + sigma)} />
              <circle cx={x} cy={y(value)} r="3.5" />
            </g>
          );
        })}
      </svg>
    </figure>
  );
}
