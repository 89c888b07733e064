/** Which effect the model lacks: the verdict, candidates as cards, and what these flights could not show. */

import { signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { Said } from "../../components/Said";
import { ScatterPlot } from "../../plots/ScatterPlot";
import { number, plural, sentenceCase, short } from "../../core/format";
import { reachOf } from "../../plots/scatter";
import { submit } from "../../core/socket";
import { connected, diagnosis, files, model } from "../../core/store";
import type { Candidate, Diagnosis, EffectSize, Evidence, ProposedEquation, Tried } from "../../core/protocol";
import { JobRows } from "../jobs/Jobs";
import { NextFlight } from "./NextFlight";
import { MakeEffect, OwnEffects } from "./OwnEffects";
import { SaveReport } from "../compare/SaveReport";
import { FlightButtons, VehicleButtons } from "../start/Buttons";
import { Named, canLearn, isRunning, namesOf, startOnFlights } from "../compare/WhereItFails";

const allExcluded = signal(false);

const WORKING = ["diagnose", "try_effect"] as const;

export function Learn() {
  const found = diagnosis.value;
  const has = found !== null && found.state !== "none";
  const busy = WORKING.some(isRunning);
  return (
    <main class="learn" aria-label="Learn">
      <div class="learn-head">
        <div>
          <h2 class="learn-verdict"><Said text={has ? found.verdict : "Which effect does the model lack?"} /></h2>
          <p class="dim"><Said text={has ? summary(found) : flightsWords()} /></p>
          {has && found.envelope !== "" && <p class="quiet"><Said text={found.envelope} /></p>}
          {found?.state === "old" && (
            <p class="caution-text">The vehicle, a flight or the choice of flights changed since. Diagnose again.</p>
          )}
        </div>
        <button
          type="button"
          class={`control ${has ? "" : "primary"}`}
          disabled={!connected.value || busy || !canLearn.value}
          onClick={() => void startOnFlights("diagnose")}
        >
          {has ? "Diagnose again" : "Find the missing effect"}
        </button>
      </div>
      {!has && !busy && <NothingYet />}
      {has && found.findings.length > 0 && <Findings found={found} />}
      {busy && <JobRows kinds={[...WORKING]} />}
      {has && <Cards found={found} />}
      <OwnEffects />
      {has && <NextFlight />}
      {has && <SaveReport of="diagnosis" made={found.has_report} />}
    </main>
  );
}

const ROLES = ["learn", "hold_out"] as const;

/** Before the first diagnosis: what it will work on, or what it lacks. */
function NothingYet() {
  const { has_vehicle } = files.value;
  return (
    <section class="card" aria-label="Before the first diagnosis">
      <ul class="findings">
        <li>{has_vehicle ? `The model of ${model.value?.name ?? "the vehicle"} is judged.` : "There is no vehicle yet."}</li>
        {ROLES.map((role) => (
          <li key={role}>
            {role === "learn" ? "Learned from" : "Held out, to judge"}: {namesOf(role).join(", ") || "no flight yet"}.
          </li>
        ))}
      </ul>
      {canLearn.value ? (
        <p class="quiet">What each flight is for is said in step 4, Compare.</p>
      ) : (
        <div class="fill">{has_vehicle ? <FlightButtons /> : <VehicleButtons />}</div>
      )}
    </section>
  );
}

function flightsWords(): string {
  const learn = namesOf("learn").length;
  const held = namesOf("hold_out").length;
  return `Every effect of the catalogue is a candidate. ${plural(learn, "flight", "flights")} to learn from, ${held} held out.`;
}

function summary(found: Diagnosis): string {
  const count = (verdict: Candidate["verdict"]): number =>
    found.candidates.filter((candidate) => candidate.verdict === verdict).length;
  const parts = [
    `${plural(count("present"), "candidate", "candidates")} present`,
    `${count("inconclusive")} inconclusive`,
    `${count("excluded")} excluded`,
  ];
  const held = found.held_out.length > 0 ? ` and ${found.held_out.length} held-out` : ", judged by each other";
  return (
    `${parts.join(", ")}, on ${plural(found.learn.length, "flight", "flights")}${held}. ` +
    `${found.probabilities} The fit is ${found.fit}.`
  );
}

/** Beside the verdict, which may say to read them. */
function Findings({ found }: { found: Diagnosis }) {
  return (
    <section aria-labelledby="findings-title">
      <h3 id="findings-title">Findings</h3>
      <ul class="findings">
        {found.findings.map((sentence) => (
          <li key={sentence} class="quiet">
            <Said text={sentenceCase(sentence)} />
          </li>
        ))}
      </ul>
    </section>
  );
}

function percent(share: number): string {
  return `${Math.round(100 * share)} %`;
}

function Cards({ found }: { found: Diagnosis }) {
  const tried = model.value?.tried ?? null;
  const large = found.candidates.filter(
    ({ verdict, name }) => verdict === "present" || verdict === "useful proxy" || name === tried?.effect,
  );
  const open = found.candidates.filter((candidate) => candidate.verdict === "inconclusive" && !large.includes(candidate));
  const excluded = found.candidates.filter((each) => each.verdict === "excluded" && !large.includes(each));
  const other = tried !== null && !large.some(({ name }) => name === tried.effect) ? tried : null;
  return (
    <>
      {other !== null && <TrialCard tried={other} />}
      {large.map((candidate) => (
        <LargeCard key={candidate.name} candidate={candidate} tried={tried?.effect === candidate.name ? tried : null} />
      ))}
      {found.outside !== null && <Outside found={found} />}
      {found.outside === null && found.equation !== null && (
        <section class="card large" aria-label="Another law">
          <h3>Another law</h3>
          <Law found={found.equation} />
          {found.equation.effect !== "" && (
            <MakeEffect effect={found.equation.effect} forms={["equation"]} isCurrent={found.state === "current"} />
          )}
        </section>
      )}
      <div class="small-cards">
        {open.map((candidate) => (
          <SmallCard key={candidate.name} candidate={candidate} />
        ))}
        {allExcluded.value && excluded.map((candidate) => <SmallCard key={candidate.name} candidate={candidate} />)}
      </div>
      <section class="card rest">
        {excluded.length > 0 && (
          <div class="block-head">
            <span>
              <Sign verdict="excluded" /> {excluded.length} more excluded
            </span>
            <button type="button" class="link" onClick={() => (allExcluded.value = !allExcluded.value)}>
              {allExcluded.value ? "Fold" : "Show all"}
            </button>
          </div>
        )}
        {found.unobservable.length > 0 && (
          <details>
            <summary>{plural(found.unobservable.length, "effect", "effects")} that no flight of this kind can show</summary>
            <ul>
              {found.unobservable.map((sentence) => (
                <li key={sentence} class="quiet">
                  <Said text={sentence} />
                </li>
              ))}
            </ul>
          </details>
        )}
        <p>
          <b>None of these?</b> <span class="dim">Left by the last model, rms: {found.left.join(", ")}</span>
        </p>
      </section>
    </>
  );
}

const SIGNS = {
  present: ["filled", "present"],
  "useful proxy": ["filled", "useful proxy"],
  inconclusive: ["half", "cannot tell"],
  excluded: ["ring", "excluded"],
} as const;

function Sign({ verdict }: { verdict: Candidate["verdict"] }) {
  return <span class={`sign ${SIGNS[verdict][0]}`} aria-hidden="true" />;
}

function VerdictWords({ verdict }: { verdict: Candidate["verdict"] }) {
  return (
    <span class="verdict-words">
      <Sign verdict={verdict} /> {SIGNS[verdict][1]}
    </span>
  );
}

function LargeCard({ candidate, tried }: { candidate: Candidate; tried: Tried | null }) {
  return (
    <section class={`card large ${tried === null ? "" : "tried"}`} aria-label={candidate.title}>
      <div class="block-head">
        <h3>
          {sentenceCase(candidate.title)} <VerdictWords verdict={candidate.verdict} />
        </h3>
        <span class="dim">
          probability <b>{percent(candidate.probability)}</b>
        </span>
      </div>
      <div class="card-body">
        <div>
          <p class="dim"><Said text={sentenceCase(candidate.reason)} /></p>
          {candidate.evidence !== null && <EvidencePlots of={candidate.evidence} title={candidate.title} />}
        </div>
        <div class="card-side">
          <div>
            <span class="quiet">Law</span>
            <p class="law">{candidate.law}</p>
          </div>
          {candidate.sizes.map((size) => (
            <Size key={size.name} size={size} />
          ))}
          <div>
            <span class="quiet">Confounded with</span>
            <p>{confoundedWords(candidate)}</p>
          </div>
          <div>
            <span class="quiet">Position error that it makes in 0.5 s</span>
            <p>
              <b>{short(candidate.error_mm)}</b> <span class="unit">mm</span>
            </p>
          </div>
        </div>
      </div>
      <Act candidate={candidate} tried={tried} />
    </section>
  );
}

function confoundedWords({ confounded }: Candidate): string {
  if (confounded.length === 0) return "nothing on these flights";
  const first = confounded.slice(0, 2).map(({ title, share }) => `${title}, ${percent(share)}`);
  return [...first, ...(confounded.length > 2 ? [`${confounded.length - 2} more`] : [])].join("; ");
}

/** As people write it; nothing for a number without unit. */
export function units(unit: string): string {
  return unit === "1" ? "" : unit.replace(/(?<=[a-z])2/g, "²").replace(/(?<=[a-z])3/g, "³");
}

/** With as many digits as its interval is worth. */
export function figure(value: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e4) return value.toPrecision(3).replace("-", "−");
  const power = Math.floor(Math.log10(size));
  const digits = (value / 10 ** power).toFixed(2).replace("-", "−");
  return `${digits}·10${raised(power)}`;
}

/** A value and its standard error with the same places, two of them uncertain. */
function measured(value: number, sigma: number): string {
  const size = Math.max(Math.abs(value), sigma);
  if (!(sigma > 0) || size >= 1e4) return `${figure(value)} ± ${figure(sigma)}`;
  const power = size < 1e-3 ? Math.floor(Math.log10(size)) : 0;
  const places = Math.min(Math.max(0, power + 1 - Math.floor(Math.log10(sigma))), 8);
  const [middle, spread] = [value, sigma].map((each) => number(each / 10 ** power, places));
  return power === 0 ? `${middle} ± ${spread}` : `(${middle} ± ${spread})·10${raised(power)}`;
}

function raised(power: number): string {
  return [...String(power)].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");
}

function Size({ size }: { size: EffectSize }) {
  const unit = units(size.unit);
  if (size.sigma === 0) {
    return (
      <div>
        <span class="quiet">Size: {size.name}</span>
        <p>not flown: no size would have shown</p>
      </div>
    );
  }
  const reach = 1.15 * Math.max(Math.abs(size.high), Math.abs(size.low), size.usual, size.smallest_visible);
  const low = Math.min(0, size.low, -0.02 * reach);
  const place = (value: number): string => `${(100 * (value - low)) / (reach - low)}%`;
  return (
    <div>
      <span class="quiet">Size ± σ: {size.name}</span>
      <p>
        <b>
          {measured(size.value, size.sigma)}
        </b>{" "}
        <span class="unit">{unit}</span>
      </p>
      <div class="size-bar" aria-hidden="true">
        <span class="size-zero" style={{ left: place(0) }} />
        <span class="size-usual" style={{ left: place(size.usual) }} />
        <span class="size-range" style={{ left: place(size.low), right: `calc(100% - ${place(size.high)})` }} />
        <span class="size-dot" style={{ left: place(size.value) }} />
      </div>
      <p class="quiet">
        bar: 90 % interval; usual {figure(size.usual)}; would show from {figure(size.smallest_visible)} {unit}
      </p>
    </div>
  );
}

function EvidencePlots({ of, title }: { of: Evidence; title: string }) {
  const [speaks, left] = useMemo(() => {
    const first = {
      points: [{ x: of.x, y: of.y, colour: "residual" }],
      lines: [{ x: of.effect_x, y: of.effect_y, colour: "accent", dash: [5, 3] }],
    };
    const second = {
      points: [
        { x: of.held_x, y: of.held_before, colour: "planned" },
        { x: of.held_x, y: of.held_after, rings: of.held_x.map(() => true), colour: "measured" },
      ],
      lines: [],
    };
    const reach = reachOf([first, second]);
    return [
      { ...first, reach },
      { ...second, reach },
    ] as const;
  }, [of]);
  const axis = `${of.variable.words}${of.variable.unit === "" ? "" : `, ${of.variable.unit}`}`;
  return (
    <div class="evidence">
      <figure>
        <figcaption class="quiet">
          <Named name={of.channel} />, {of.unit}: dots the effect and what is left, dashed the effect
        </figcaption>
        <ScatterPlot what={speaks} height={190} label={`Evidence for ${title}`} />
      </figure>
      {of.held_x.length > 0 && (
        <figure>
          <figcaption class="quiet">left on held-out flights: dots before, rings after</figcaption>
          <ScatterPlot what={left} height={190} label={`Residual on held-out flights before and after ${title}`} />
        </figure>
      )}
      <p class="quiet against">against {axis}</p>
    </div>
  );
}

function Act({ candidate, tried }: { candidate: Candidate; tried: Tried | null }) {
  const inModel = model.value?.effects.includes(candidate.name) ?? false;
  if (tried !== null) return <TrialActs tried={tried} />;
  if (inModel) return <p class="quiet card-foot">In the vehicle file.</p>;
  return (
    <div class="card-foot">
      <span class="quiet">Nothing is changed by trying.</span>
      <button
        type="button"
        class={`control ${candidate.verdict === "present" ? "primary" : ""}`}
        disabled={!connected.value || isRunning("try_effect")}
        onClick={() => void startOnFlights("try_effect", { effect: candidate.name.split("[")[0] ?? candidate.name })}
      >
        {candidate.verdict === "present" ? "Try: refit with it" : "Try anyway"}
      </button>
    </div>
  );
}

function TrialActs({ tried }: { tried: Tried }) {
  const at = tried.quantities.indexOf("position");
  const [before, after, unit] = [tried.before[at], tried.after[at], tried.units[at]];
  const next = model.value?.versions.length ?? 0;
  return (
    <div class="card-foot">
      <span>
        {before !== undefined && after !== undefined ? (
          <>
            <b>
              {figure(before)} → {figure(after)} {unit}
            </b>{" "}
            <span class="dim">after 0.5 s on held-out {tried.held_out.join(", ")}; it {tried.verdict}</span>
          </>
        ) : (
          <span class="caution-text">{sentenceCase(tried.verdict)}</span>
        )}
      </span>
      <span class="acts-row">
        <button type="button" class="control" onClick={() => void submit({ type: "drop_tried" })}>
          Discard
        </button>
        <button
          type="button"
          class="control primary"
          disabled={!connected.value}
          onClick={() => void submit({ type: "keep", vehicle_hash: tried.vehicle_hash })}
        >
          Keep as version {next}
        </button>
      </span>
    </div>
  );
}

/** A trial of an effect that the shown diagnosis does not speak of. */
function TrialCard({ tried }: { tried: Tried }) {
  return (
    <section class="card large tried" aria-label={tried.title}>
      <h3>{sentenceCase(tried.title)}, tried</h3>
      <TrialActs tried={tried} />
    </section>
  );
}

function SmallCard({ candidate }: { candidate: Candidate }) {
  return (
    <section class="card" aria-label={candidate.title}>
      <div class="block-head">
        <h3>{sentenceCase(candidate.title)}</h3>
        <VerdictWords verdict={candidate.verdict} />
      </div>
      <p class="dim"><Said text={sentenceCase(candidate.reason)} /></p>
      {candidate.outlook !== "" && <p class="quiet"><Said text={sentenceCase(candidate.outlook)} />.</p>}
      {candidate.confounded.length > 0 && <p class="quiet">Confounded with {confoundedWords(candidate)}.</p>}
      <div class="spring" />
      <button
        type="button"
        class="control"
        disabled={!connected.value || isRunning("try_effect")}
        onClick={() => void startOnFlights("try_effect", { effect: candidate.name.split("[")[0] ?? candidate.name })}
      >
        Try anyway
      </button>
    </section>
  );
}

function Outside({ found }: { found: Diagnosis }) {
  const curve = found.outside;
  const law = found.equation;
  const what = useMemo(
    () => ({
      points: [],
      lines: curve === null ? [] : [{ x: curve.x, y: curve.y, band: curve.band, colour: "residual" }],
    }),
    [curve],
  );
  if (curve === null) return null;
  return (
    <section class="card large" aria-label="No known effect">
      <div class="block-head">
        <h3>
          No known effect: <Named name={curve.channel} /> against <Named name={curve.variable.name} />
        </h3>
        <span class="dim">
          probability <b>{percent(curve.probability)}</b>
        </span>
      </div>
      <p class="dim">
        The {curve.words} follows {curve.variable.words}, from {figure(Math.min(...curve.y))} to{" "}
        {figure(Math.max(...curve.y))} {curve.unit}.
      </p>
      <ScatterPlot what={what} height={200} label="The curve that no known effect explains" />
      <p class="quiet against">
        <Named name={curve.channel} />, {curve.unit}, against {curve.variable.words}
        {curve.variable.unit !== "" && `, ${curve.variable.unit.replace("2", "²")}`}; band: 95 %
      </p>
      {law !== null && <Law found={law} />}
      {curve.effect === "" ? (
        <p class="quiet card-foot"><Said text={`No effect can be made of this curve: ${curve.advice}.`} /></p>
      ) : (
        <MakeEffect
          key={curve.effect}
          effect={law?.effect ?? curve.effect}
          forms={[...(law === null ? [] : ["equation" as const]), "spline", "polynomial"]}
          isCurrent={found.state === "current"}
        />
      )}
    </section>
  );
}

/** A proposed equation, how likely its form is, and what would tell it from the next one. */
function Law({ found }: { found: ProposedEquation }) {
  return <p class="dim"><Said text={sentenceCase(found.sentence)} />.</p>;
}
