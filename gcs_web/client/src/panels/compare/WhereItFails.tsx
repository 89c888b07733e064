/** Where the model fails: share explained by channel and variable, the residual against one of them, the way to Learn. */

import { useMemo } from "preact/hooks";
import { computed, signal } from "@preact/signals";
import { Badge } from "../../components/Badge";
import { Said } from "../../components/Said";
import { ScatterPlot } from "../../plots/ScatterPlot";
import { editable, number, sentenceCase, short } from "../../core/format";
import { bin, cards, chosen, gapped, goTo, moments, opened, pathColour, scatter, splitGaps, streamKeys } from "./flights";
import type { Channel } from "./flights";
import { send } from "../../core/socket";
import { announce, comparison, connected, files, jobs, model, step } from "../../core/store";
import type { ChannelResidual, Comparison, Scatter, VariableName } from "../../core/protocol";
import { JobRows } from "../jobs/Jobs";

const NOTABLE = 0.05;
const FIRST_ROWS = 9;
const allVariables = signal(false);

/** The flights of a role; one whose checks are still made can be read all the same. */
export function namesOf(role: "learn" | "hold_out"): string[] {
  return cards.value
    .filter((card) => card.role === role && card.state !== "unreadable")
    .map(({ name }) => name)
    .sort();
}

export async function startOnFlights(kind: string, more: Record<string, string | boolean> = {}): Promise<boolean> {
  const reply = await send({
    type: "start_job",
    kind,
    arguments: {
      learn: namesOf("learn"),
      held_out: namesOf("hold_out"),
      split_gaps: splitGaps.value && gapped.value.length > 0,
      ...more,
    },
  });
  if (reply.error !== "") announce(reply.error, "danger");
  return reply.error === "";
}

export function isRunning(kind: string): boolean {
  return jobs.value.jobs.some((job) => job.kind === kind && (job.state === "running" || job.state === "waiting"));
}

export function WhereItFails() {
  const found = comparison.value;
  const has = found !== null && found.state !== "none";
  return (
    <>
      <section class="verdict">
        <div class="block-head">
          <h2>Where it fails</h2>
          <ModelBadge />
        </div>
        {has ? (
          <p>Share of the residual, %, that a curve of one variable predicts {found.judged_how}</p>
        ) : (
          <p>Which force or torque the model lacks, and what it depends on; best judged on a held-out flight.</p>
        )}
        {found?.state === "old" && (
          <p class="caution-text">The vehicle, a flight or the choice of flights changed since. Compare again.</p>
        )}
      </section>
      {!has && <Tracked />}
      {isRunning("compare") && (
        <section class="block">
          <JobRows kinds={["compare"]} />
        </section>
      )}
      {has && (
        <>
          <HeatMap found={found} />
          {scatter.value !== null && <Against found={scatter.value} />}
          <Errors found={found} />
        </>
      )}
      <div class="spring" />
      <div class="acts">
        <button
          type="button"
          class={`control tall ${has ? "" : "primary"}`}
          disabled={!connected.value || isRunning("compare") || !canLearn.value}
          onClick={() => void startOnFlights("compare")}
        >
          {has ? "Compare again" : "Compare with the model"}
        </button>
        {has && (
          <button type="button" class="control tall primary" onClick={() => (step.value = 5)}>
            Find the missing effect
          </button>
        )}
      </div>
    </>
  );
}

/** Whether there is something to compare: a vehicle, and a flight to learn from. */
export const canLearn = computed(() => files.value.has_vehicle && namesOf("learn").length > 0);

/** Before anything is compared with the model: how well the flights held their path. */
function Tracked() {
  const known = cards.value.filter(({ tracking_mean_m }) => tracking_mean_m !== null);
  const shown = opened.value.length > 0 ? known.filter(({ name }) => opened.value.some((one) => one.name === name)) : known;
  if (shown.length === 0) return <LacksToCompare />;
  return (
    <section class="block">
      <div class="block-head">
        <h3>Tracking error</h3>
        <span class="quiet">mm, on the trajectory</span>
      </div>
      <table class="table errors">
        <thead>
          <tr>
            <th class="words">flight</th>
            <th>mean</th>
            <th>worst</th>
          </tr>
        </thead>
        <tbody>
          {shown.map(({ name, tracking_mean_m, tracking_worst_m }) => (
            <tr key={name}>
              <td class="words">{name}</td>
              <td>{short(1000 * (tracking_mean_m ?? 0))}</td>
              <td>{tracking_worst_m === null ? "–" : short(1000 * tracking_worst_m)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

function LacksToCompare() {
  if (canLearn.value) return null;
  const lacks = files.value.has_vehicle ? "There is no flight to learn from yet." : "There is no vehicle to compare with yet.";
  return (
    <section class="block">
      <p class="quiet">{lacks}</p>
      <button type="button" class="control" onClick={() => (step.value = 0)}>
        Bring one
      </button>
    </section>
  );
}

function ModelBadge() {
  const current = model.value?.versions.find((version) => version.current);
  if (current === undefined) return null;
  return <Badge>model: {current.number === 0 ? "as given" : `version ${current.number}`}</Badge>;
}

/** Variables of four rotors in one row: the best of them. */
interface RowOfMap {
  variable: VariableName;
  name: string;
  indices: number[];
}

function rowsOf(variables: readonly VariableName[]): RowOfMap[] {
  const rows = new Map<string, RowOfMap>();
  variables.forEach((variable, i) => {
    const name = variable.name.replace(/_\d/, "");
    const row = rows.get(name);
    if (row === undefined) rows.set(name, { variable, name, indices: [i] });
    else row.indices.push(i);
  });
  return [...rows.values()];
}

function best(channel: ChannelResidual, row: RowOfMap): { share: number; index: number } {
  let found = { share: 0, index: row.indices[0] ?? 0 };
  for (const index of row.indices) {
    const share = channel.shares[index] ?? 0;
    if (share > found.share) found = { share, index };
  }
  return found;
}

/** What a variable explains, in the channel where that is most. */
function mostOf(found: Comparison, row: RowOfMap): number {
  return Math.max(...found.channels.map((channel) => best(channel, row).share));
}

function HeatMap({ found }: { found: Comparison }) {
  const rows = rowsOf(found.variables);
  const order = new Map(rows.map((row) => [row, mostOf(found, row)]));
  const telling = [...rows].sort((a, b) => (order.get(b) ?? 0) - (order.get(a) ?? 0)).slice(0, FIRST_ROWS);
  const shown = allVariables.value ? rows : telling;
  return (
    <section class="block heat" aria-label="Share explained">
      <table class="heat-map">
        <thead>
          <tr>
            <td />
            {found.channels.map(({ channel, rms, unit }) => (
              <th key={channel} scope="col">
                <Named name={channel} />
                <span class="unit">
                  {editable(Number(rms.toPrecision(2)))}
                  <br />
                  {unit}
                </span>
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {shown.map((row) => (
            <tr key={row.name}>
              <th scope="row" title={sentenceCase(row.variable.words)}>
                <Named name={row.indices.length > 1 ? row.name : row.variable.name} />
              </th>
              {found.channels.map((channel) => (
                <Cell key={channel.channel} channel={channel} row={row} found={found} />
              ))}
            </tr>
          ))}
        </tbody>
      </table>
      <div class="block-head quiet">
        <span>Below the names: rms of the residual. n: best of four rotors.</span>
        {rows.length > FIRST_ROWS && (
          <button type="button" class="link small" onClick={() => (allVariables.value = !allVariables.value)}>
            {allVariables.value ? "Fewer" : `All ${rows.length}`}
          </button>
        )}
      </div>
    </section>
  );
}

function Cell({ channel, row, found }: { channel: ChannelResidual; row: RowOfMap; found: Comparison }) {
  const { share, index } = best(channel, row);
  const variable = found.variables[index]?.name ?? "";
  const now = chosen.value;
  const isChosen = now?.channel === channel.channel && row.indices.some((i) => found.variables[i]?.name === now.variable);
  return (
    <td>
      <button
        type="button"
        class="heat-cell"
        aria-pressed={isChosen}
        aria-label={`${channel.channel} against ${variable}: ${Math.round(100 * share)} %`}
        style={{ "--share": `${Math.round(100 * share)}%` }}
        onClick={() => look(channel.channel, variable)}
      >
        {share >= NOTABLE ? Math.round(100 * share) : ""}
      </button>
    </td>
  );
}

/** Look at a channel everywhere: scatter, plots, path. */
function look(channel: string, variable: string): void {
  chosen.value = { channel, variable };
  const others = streamKeys.value.filter((key) => !/^(residual_)?[FM]_[xyz]$/.test(key));
  streamKeys.value = [...others, channel, `residual_${channel}`];
  pathColour.value = channel as Channel;
}

/** `F_x` with its index set low. */
export function Named({ name }: { name: string }) {
  const parts = name.split(/(\s|\/)/);
  return (
    <span class="symbol">
      {parts.map((part, i) => {
        const [stem, index, ...rest] = part.split("_");
        if (index === undefined) return part;
        return (
          <span key={i}>
            {stem}
            <sub>{[index, ...rest].join(" ")}</sub>
          </span>
        );
      })}
    </span>
  );
}

function Against({ found }: { found: Scatter }) {
  const what = useMemo(
    () => ({
      points: [
        {
          x: found.x,
          y: found.y,
          rings: found.flight.map((i) => (found.held_out[i] ?? false)),
          colour: "residual",
        },
      ],
      lines: [{ x: found.bin_x, y: found.bin_mean, band: found.bin_band, colour: "measured" }],
      range: bin.value,
    }),
    [found, bin.value],
  );
  const { variable } = found;
  return (
    <section class="block" aria-label="Residual against a variable">
      <div class="block-head">
        <h3>
          Residual <Named name={found.channel} /> against <Named name={variable.name} />
        </h3>
        <span class="quiet">{Math.round(100 * found.share)} % explained</span>
      </div>
      <ScatterPlot
        what={what}
        height={236}
        label={`Residual ${found.channel} in ${found.unit} against ${variable.words}`}
        onPick={(x) => choose(found, nearest(found, x))}
      />
      <p class="quiet scatter-axes">
        <span>
          <Named name={found.channel} />, {found.unit}
        </span>
        <span>
          {variable.words}
          {variable.unit !== "" && `, ${variable.unit.replace("2", "²")}`}
        </span>
      </p>
      <p class="quiet keys">
        <span class="key-dot" /> learned on <span class="key-ring" /> held-out <span class="key-line" /> mean, 95 % band
      </p>
      <MomentList found={found} />
    </section>
  );
}

/** The bin whose centre is nearest. */
function nearest(found: Scatter, x: number): number {
  return found.bin_x.reduce((best, centre, i) => {
    const before = found.bin_x[best] ?? 0;
    return Math.abs(centre - x) < Math.abs(before - x) ? i : best;
  }, 0);
}

/** Choose a bin: its points, up to half-way to its neighbours. */
function choose(found: Scatter, at: number): void {
  const centre = found.bin_x[at];
  if (centre === undefined) return;
  const low = at === 0 ? -Infinity : 0.5 * (centre + (found.bin_x[at - 1] ?? centre));
  const high = at === found.bin_x.length - 1 ? Infinity : 0.5 * (centre + (found.bin_x[at + 1] ?? centre));
  let [from, to] = [Infinity, -Infinity];
  for (const value of found.x) {
    if (value < low || value > high) continue;
    from = Math.min(from, value);
    to = Math.max(to, value);
  }
  if (from > to) return;
  bin.value = [from, to];
  const first = moments.value.find(({ flight }) => flight === opened.value[0]?.name);
  if (first !== undefined) goTo(0.5 * (first.from_s + first.to_s));
}

/** The bin beside the chosen one, by keys; the first or the last one where none is. */
function BinButton({ found, by, words }: { found: Scatter; by: 1 | -1; words: string }) {
  const range = bin.value;
  const last = found.bin_x.length - 1;
  const next = range === null ? (by > 0 ? 0 : last) : nearest(found, 0.5 * (range[0] + range[1])) + by;
  return (
    <button type="button" class="link small" disabled={next < 0 || next > last} onClick={() => choose(found, next)}>
      {words}
    </button>
  );
}

function MomentList({ found }: { found: Scatter }) {
  const range = bin.value;
  const here = moments.value.filter(({ flight }) => opened.value.some(({ name }) => name === flight));
  const total_s = here.reduce((sum, { from_s, to_s }) => sum + to_s - from_s, 0);
  return (
    <p class="quiet">
      {range === null
        ? "Click a bin to see its moments on the timeline and on the path. "
        : `${found.variable.name} from ${number(range[0], 2)} to ${number(range[1], 2)}: ` +
          `${number(total_s, 1)} s of the open flights, shaded, and violet on the path. `}
      <span class="acts-row">
        <BinButton found={found} by={-1} words="Bin before" />
        <BinButton found={found} by={1} words="Next bin" />
        {range !== null && (
          <button type="button" class="link small" onClick={() => (bin.value = null)}>
            Clear
          </button>
        )}
      </span>
    </p>
  );
}

function Errors({ found }: { found: Comparison }) {
  return (
    <section class="block">
      <div class="block-head">
        <h3>Prediction error</h3>
        <span class="quiet">
          rms of {found.predictions}, {found.held_out.length > 0 ? "held-out flights" : "all flights"}
        </span>
      </div>
      <table class="table errors">
        <thead>
          <tr>
            <th class="words">after</th>
            {found.horizons_s.map((horizon_s) => (
              <th key={horizon_s}>{horizon_s} s</th>
            ))}
          </tr>
        </thead>
        <tbody>
          {found.errors.map((row) => (
            <tr key={row.quantity}>
              <td class="words">
                {row.quantity} <span class="unit">{row.unit}</span>
              </td>
              {row.values.map((value, i) => (
                <td key={i}>{short(value)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
      {found.remarks.map((remark) => (
        <p key={remark} class="caution-text">
          <Said text={remark} />
        </p>
      ))}
    </section>
  );
}
