/** The recorded flights: picture of the path, tracking error, what each is for, what the checks say; logs dropped in. */

import { useSignal } from "@preact/signals";
import { Badge } from "../../components/Badge";
import { FileButton } from "../../components/FileButton";
import { Icon } from "../../components/Icon";
import { Said } from "../../components/Said";
import { dayAndTime, number, plural, sentenceCase } from "../../core/format";
import {
  LETTERS,
  LOGS,
  cards,
  discardFlight,
  fixFlight,
  gapped,
  goToMark,
  incoming,
  marks,
  open,
  renameFlight,
  setNote,
  setRole,
  splitGaps,
  takeFile,
  takeLog,
  toggleOpen,
  undo,
} from "./flights";
import { flights } from "../../core/store";
import type { Finding, FlightCard, Incoming } from "../../core/protocol";

export function FlightList() {
  const isOver = useSignal(false);
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    isOver.value = false;
    for (const file of event.dataTransfer?.files ?? []) void takeFile(file);
  };
  return (
    <section
      class={`side ${isOver.value ? "over" : ""}`}
      aria-labelledby="flights-title"
      onDragOver={(event) => {
        event.preventDefault();
        isOver.value = true;
      }}
      onDragLeave={() => (isOver.value = false)}
      onDrop={drop}
    >
      <div class="side-head">
        <div class="block-head">
          <h2 id="flights-title">Flights</h2>
          <FileButton name="Import log" kinds={LOGS} onFile={(file) => void takeFile(file)} />
        </div>
        <p class="quiet">Mean tracking error, mm; what each flight is for</p>
      </div>
      {incoming.value !== null && <ColumnMap log={incoming.value} />}
      <List />
      <Gaps />
      <div class="spring" />
      <UndoLine />
      <p class="drop-zone">Drop CSV, ULog, MCAP or Parquet</p>
    </section>
  );
}

function Gaps() {
  if (gapped.value.length === 0) return null;
  return (
    <label class="switch gaps">
      <input
        type="checkbox"
        checked={splitGaps.value}
        onChange={(event) => (splitGaps.value = event.currentTarget.checked)}
      />
      <span>
        {gapped.value.join(", ")}: gaps. Take the pieces between them as flights of their own{" "}
        {!splitGaps.value && <span class="caution-text">, or these logs are refused</span>}
      </span>
    </label>
  );
}

function List() {
  if (flights.value === null) return <p class="empty">Looking for flights ...</p>;
  if (cards.value.length === 0) return <p class="empty">No flights yet. Fly a plan, or drop a log.</p>;
  return (
    <ul class="flight-list">
      {cards.value.map((card) => (
        <Card key={card.name} card={card} />
      ))}
    </ul>
  );
}

function Card({ card }: { card: FlightCard }) {
  const place = open.value.indexOf(card.name);
  const isOpen = place >= 0;
  return (
    <li class={`flight ${isOpen ? "open" : ""}`}>
      <button
        type="button"
        class="flight-open"
        aria-pressed={isOpen}
        disabled={card.state !== "ready"}
        title="Open; with Ctrl or Shift beside the others"
        onClick={(event) => toggleOpen(card.name, !(event.ctrlKey || event.metaKey || event.shiftKey))}
      >
        <Thumbnail path_m={card.path_m} />
        <span class="flight-words">
          <b>{card.name}</b>
          <span class="quiet">{card.state === "reading" ? "reading ..." : about(card)}</span>
        </span>
        <span class="flight-figures">
          <b>{card.tracking_mean_m === null ? "" : number(1000 * card.tracking_mean_m, 0)}</b>
          {isOpen && <b class="accent-text">{LETTERS[place]}</b>}
        </span>
      </button>
      {card.state === "unreadable" && <p class="danger-text flight-note"><Said text={card.sentence} /></p>}
      {card.state === "ready" && (
        <div class="flight-row">
          <Role card={card} />
          <Checks card={card} />
          {!isOpen && open.value.length > 0 && (
            <button
              type="button"
              class="link small"
              aria-label={`Open ${card.name} beside`}
              onClick={() => toggleOpen(card.name, false)}
            >
              beside
            </button>
          )}
        </div>
      )}
      {card.note !== "" && !isOpen && <p class="quiet flight-note">{card.note}</p>}
      {isOpen && <Written key={card.name} card={card} />}
      {isOpen && <Findings card={card} />}
    </li>
  );
}

/** Its name and what people write about it. */
function Written({ card }: { card: FlightCard }) {
  const name = useSignal(card.name);
  return (
    <div class="flight-note written">
      <label>
        <span class="quiet">Name</span>
        <input
          value={name.value}
          onInput={(event) => (name.value = event.currentTarget.value)}
          onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
          onBlur={() => {
            if (name.value.trim() !== card.name && name.value.trim() !== "") void renameFlight(card.name, name.value);
          }}
        />
      </label>
      <label>
        <span class="quiet">Note</span>
        <textarea
          rows={2}
          maxLength={500}
          placeholder="What was special about it"
          value={card.note}
          onChange={(event) => void setNote(card.name, event.currentTarget.value)}
        />
      </label>
    </div>
  );
}

function about(card: FlightCard): string {
  if (card.state === "unreadable") return "cannot be read";
  const words = [dayAndTime(card.recorded_at), `${number(card.duration_s, 1)} s`];
  if (card.trajectory !== "" && card.trajectory !== card.name) words.push(card.trajectory);
  return words.join(", ");
}

const SIZE = { width: 52, height: 36 };

function Thumbnail({ path_m }: { path_m: readonly number[] }) {
  const xs = path_m.filter((_, i) => i % 2 === 0);
  const ys = path_m.filter((_, i) => i % 2 === 1);
  const [left, top] = [Math.min(...xs), Math.max(...ys)];
  const span = Math.max(Math.max(...xs) - left, (top - Math.min(...ys)) * (SIZE.width / SIZE.height), 1e-6);
  const scale = (SIZE.width - 6) / span;
  const points = xs.map((x, i) => `${(3 + (x - left) * scale).toFixed(1)},${(3 + (top - (ys[i] ?? 0)) * scale).toFixed(1)}`);
  return (
    <svg class="thumbnail" width={SIZE.width} height={SIZE.height} aria-hidden="true">
      {xs.length > 1 && <polyline points={points.join(" ")} fill="none" stroke="currentColor" stroke-width="1.5" />}
    </svg>
  );
}

const ROLES = [
  ["learn", "learn from"],
  ["hold_out", "held-out"],
  ["leave", "left out"],
] as const;

function Role({ card }: { card: FlightCard }) {
  return (
    <select
      class={`role ${card.role}`}
      aria-label={`What ${card.name} is for`}
      value={card.role}
      onChange={(event) => {
        const role = ROLES.find(([key]) => key === event.currentTarget.value)?.[0];
        if (role !== undefined) void setRole(card.name, role);
      }}
    >
      {ROLES.map(([key, words]) => (
        <option key={key} value={key}>
          {words}
        </option>
      ))}
    </select>
  );
}

function Checks({ card }: { card: FlightCard }) {
  const errors = card.findings.filter(({ level }) => level === "error").length;
  if (card.findings.length === 0) {
    return (
      <Badge>
        <Icon name="check" /> {card.fixed.length > 0 ? "checks, fixed" : "checks"}
      </Badge>
    );
  }
  return <Badge tone={errors > 0 ? "danger" : "caution"}>{plural(card.findings.length, "finding", "findings")}</Badge>;
}

function Findings({ card }: { card: FlightCard }) {
  const isFixable = card.findings.some(({ fixable }) => fixable);
  return (
    <div class="flight-note">
      {card.findings.map((finding) => (
        <FindingLine key={finding.sentence} finding={finding} flight={card.name} />
      ))}
      {card.inconclusive.map((sentence) => (
        <p key={sentence} class="quiet">
          <Said text={`Not checked: ${sentence}`} />
        </p>
      ))}
      {card.notes.map((sentence) => (
        <p key={sentence} class="quiet">
          <Said text={`Note: ${sentence}`} />
        </p>
      ))}
      {card.fixed.map((sentence) => (
        <p key={sentence} class="quiet">
          <Said text={`Fixed: ${sentence}`} />
        </p>
      ))}
      <p class="quiet">
        {card.vehicle_said !== "" && <Said text={`${sentenceCase(card.vehicle_said)}. `} />}
        <button type="button" class="link small" onClick={() => void discardFlight(card.name)}>
          Discard
        </button>
      </p>
      {isFixable && (
        <button type="button" class="control" onClick={() => void fixFlight(card.name)}>
          Apply the fixes to a new log
        </button>
      )}
    </div>
  );
}

function FindingLine({ finding, flight }: { finding: Finding; flight: string }) {
  const first = marks.value.find((mark) => mark.flight === flight && mark.finding.sentence === finding.sentence);
  return (
    <>
      <p class={finding.level === "error" ? "danger-text" : "caution-text"}>
        <Said text={`${finding.sentence}.`} />
      </p>
      <p class="quiet">
        <Said text={finding.fix} />{" "}
        {first !== undefined && (
          <button type="button" class="link small" onClick={() => goToMark(first)}>
            Go there
          </button>
        )}{" "}
        {finding.fixable && (
          <button type="button" class="link small" onClick={() => void fixFlight(flight, finding.sentence)}>
            Apply this to a new log
          </button>
        )}
      </p>
    </>
  );
}

function UndoLine() {
  const last = undo.value;
  if (last === null) return null;
  return (
    <p class="undo-line">
      {last.words}.{" "}
      <button
        type="button"
        class="link"
        onClick={() => {
          undo.value = null;
          void last.act();
        }}
      >
        Undo
      </button>
    </p>
  );
}

/** What the columns of a foreign log were taken for, to read and correct. */
function ColumnMap({ log }: { log: Incoming }) {
  const text = useSignal(log.column_map);
  const refusal = useSignal("");
  return (
    <form
      class="column-map"
      onSubmit={(event) => {
        event.preventDefault();
        void takeLog(log.name, text.value).then((error) => (refusal.value = error));
      }}
    >
      <h3>Columns of {log.name}</h3>
      <ul class="guesses">
        {log.guesses.map((guess) => (
          <li key={guess.name}>
            <b>{guess.name}</b> <span class="dim">{guess.columns.join(", ")}</span>
            <span class="quiet"> {guess.reasons.join("; ")}</span>
          </li>
        ))}
      </ul>
      {log.unused.length > 0 && <p class="quiet">Not used: {log.unused.join(", ")}</p>}
      <textarea
        aria-label="Column map (TOML)"
        rows={8}
        spellcheck={false}
        value={text.value}
        onInput={(event) => (text.value = event.currentTarget.value)}
      />
      {refusal.value !== "" && <p class="danger-text">{refusal.value}</p>}
      <div class="acts-row">
        <button type="submit" class="control">
          Read with these columns
        </button>
        <button type="button" class="link" onClick={() => (incoming.value = null)}>
          Cancel
        </button>
      </div>
    </form>
  );
}
