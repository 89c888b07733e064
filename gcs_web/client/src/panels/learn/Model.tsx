/** The vehicle's model: staircase of its versions, before and after on held-out flights, parameters. */

import { Fragment } from "preact";
import { Badge } from "../../components/Badge";
import { Said } from "../../components/Said";
import { dayAndTime, sentenceCase, short } from "../../core/format";
import { submit } from "../../core/socket";
import { connected, diagnosis, files, model } from "../../core/store";
import type { ParameterRow, Stair, Tried, VehicleVersion } from "../../core/protocol";
import { Compensation } from "../fly/Compensation";
import { EffectFilesWaiting } from "./EffectFiles";
import { Identified } from "./Identified";
import { figure, units } from "./Learn";
import { namesOf } from "../compare/WhereItFails";

export function Versions() {
  const now = model.value;
  const versions = [...(now?.versions ?? [])].reverse();
  return (
    <section class="side" aria-labelledby="versions-title">
      <div class="side-head">
        <h2 id="versions-title">Versions</h2>
        <p class="quiet">of the vehicle file. Bars: position error after 0.5 s, mm, log scale</p>
      </div>
      <Staircase />
      <ul class="versions">
        {now?.tried != null && <TriedRow tried={now.tried} />}
        {versions.map((version) => (
          <Version key={version.number} version={version} />
        ))}
      </ul>
      <NotAdded />
      <div class="spring" />
      <section class="side-foot">
        <h3>Flights</h3>
        <p>
          <span>{namesOf("learn").join(", ") || "none"}</span> <Badge>learned on</Badge>
        </p>
        <p>
          <span>{namesOf("hold_out").join(", ") || "none"}</span> <Badge tone="accent">held-out</Badge>
        </p>
      </section>
    </section>
  );
}

function TriedRow({ tried }: { tried: Tried }) {
  return (
    <li class="version now">
      <b>try</b>
      <span>
        <b>+ {tried.title}</b>
        <span class="quiet">refitted{tried.use === "" ? "" : `, the fit is ${tried.use}`}; not kept yet</span>
      </span>
    </li>
  );
}

function Version({ version }: { version: VehicleVersion }) {
  const what = `${version.action} ${version.effect}`.trim();
  return (
    <li class={`version ${version.current && model.value?.tried == null ? "now" : ""} ${version.undone ? "undone" : ""}`}>
      <b>{version.number}</b>
      <span>
        <b>{version.number === 0 ? "as given" : what}</b>
        <span class="quiet">
          {dayAndTime(version.when)}
          {version.undone && ", undone"}
          {version.verdict !== "" && `; ${version.verdict}`}
        </span>
      </span>
      {version.current ? (
        <span class="quiet">now</span>
      ) : (
        <button
          type="button"
          class="link small"
          disabled={!connected.value}
          onClick={() => void submit({ type: "return_to", version: version.number })}
        >
          Return
        </button>
      )}
    </li>
  );
}

/** Position error after 0.5 s of the diagnosis' models, on a log scale. */
function Staircase() {
  const found = diagnosis.value;
  if (found === null || found.state === "none") return null;
  const at = found.horizons.indexOf("0.5 s");
  const steps = found.staircase.map((stair: Stair) => ({ name: stair.model, value: stair.errors_mm[at] ?? 0 }));
  const values = steps.map(({ value }) => Math.max(value, 1e-3));
  const [low, high] = [Math.min(...values) / 2, Math.max(...values) * 1.6];
  const height = (value: number): number => (100 * Math.log(value / low)) / Math.log(high / low);
  return (
    <ol class="staircase" aria-label="Position error after 0.5 s by model, mm">
      {steps.map(({ name, value }, i) => (
        <li key={name} class={i === steps.length - 1 ? "last" : ""}>
          <span class="stair-space">
            <span class="stair-bar" style={{ height: `${height(Math.max(value, 1e-3))}%` }}>
              <b>{short(value)}</b>
            </span>
          </span>
          <span class="quiet" title={name}>
            {name}
          </span>
        </li>
      ))}
    </ol>
  );
}

/** What the diagnosis tried and did not add: it did not help, or a confounded effect or a free curve explains as much. */
function NotAdded() {
  const added = ["added", "useful proxy"];
  const attempts = diagnosis.value?.attempts.filter(({ outcome }) => !added.includes(outcome)) ?? [];
  if (attempts.length === 0) return null;
  return (
    <section class="side-foot">
      <h3>Tried, not added</h3>
      {attempts.map((attempt) => (
        <p key={attempt.name} class="quiet">
          <b>{sentenceCase(attempt.title)}</b>, {attempt.outcome}: <Said text={attempt.sentence} />
        </p>
      ))}
    </section>
  );
}

export function ModelInspector() {
  const now = model.value;
  if (now === null) {
    return (
      <>
        <p class="empty">
          {files.value.has_vehicle ? "The vehicle file is not read yet." : "No vehicle yet: its parameters stand here."}
        </p>
        <EffectFilesWaiting />
      </>
    );
  }
  return (
    <>
      <EffectFilesWaiting />
      {now.tried !== null && <BeforeAndAfter tried={now.tried} />}
      <section class="verdict">
        <h2>Parameters</h2>
        <p>
          <Said text={`${now.name}. Effects: ${now.titles.join(", ") || "none"}.`} />
        </p>
      </section>
      <Parameters rows={now.parameters} tried={now.tried} />
      <Identified />
      <Compensation />
    </>
  );
}

function BeforeAndAfter({ tried }: { tried: Tried }) {
  return (
    <section class="block">
      <h2>Held-out, before and after</h2>
      <p class="dim">
        {tried.held_out.length > 0
          ? `Prediction error after 0.5 s on ${tried.held_out.join(", ")}, rms`
          : "No flight is held out: nothing judges the change."}
      </p>
      {tried.quantities.map((quantity, i) => (
        <Bars
          key={quantity}
          quantity={quantity}
          unit={tried.units[i] ?? ""}
          values={[tried.as_it_was[i], tried.before[i], tried.after[i]]}
        />
      ))}
      <p class="quiet keys">
        <span class="key-bar was" /> as it was <span class="key-bar before" /> refitted <span class="key-bar after" />{" "}
        with effect
      </p>
      {tried.reasons.map((reason) => (
        <p key={reason} class="caution-text">
          <Said text={sentenceCase(reason)} />
        </p>
      ))}
    </section>
  );
}

function Bars({ quantity, unit, values }: { quantity: string; unit: string; values: (number | undefined)[] }) {
  const known = values.filter((value) => value !== undefined);
  if (known.length < values.length) return null;
  const most = Math.max(...known, 1e-12);
  return (
    <div class="bars">
      <span>
        {quantity} <span class="unit">{unit}</span>
      </span>
      <div>
        {known.map((value, i) => (
          <span key={i} class="bar-line">
            <span class={`bar ${["was", "before", "after"][i]}`} style={{ width: `${(70 * value) / most}%` }} />
            {figure(value)}
          </span>
        ))}
      </div>
    </div>
  );
}

function Parameters({ rows, tried }: { rows: readonly ParameterRow[]; tried: Tried | null }) {
  const isTouched = ({ name }: ParameterRow): boolean =>
    tried?.changes.some((line) => line.includes(`${name}:`)) ?? false;
  return (
    <div class="table-scroll all-parameters">
      <table class="table parameters">
        <colgroup>
          <col />
          <col style={{ width: "88px" }} />
          <col style={{ width: "72px" }} />
          <col style={{ width: "60px" }} />
        </colgroup>
        <thead>
          <tr>
            <th class="words">parameter</th>
            <th>value</th>
            <th>± σ</th>
            <th class="words">unit</th>
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <Fragment key={row.name}>
              <tr class={isTouched(row) ? "touched" : ""}>
                <td class="words" title={row.name}>
                  {row.words}
                </td>
                <td>{figure(row.value)}</td>
                <td>{row.sigma > 0 ? figure(row.sigma) : "exact"}</td>
                <td class="words">{units(row.unit)}</td>
              </tr>
              <tr class={`source ${isTouched(row) ? "touched" : ""}`}>
                <td class="words" colSpan={4}>
                  <Said text={row.source} />
                </td>
              </tr>
            </Fragment>
          ))}
        </tbody>
      </table>
    </div>
  );
}
