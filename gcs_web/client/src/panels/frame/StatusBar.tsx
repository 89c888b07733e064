/** The foot of the page: the last notice, what is saved, who is here. */

import { signal } from "@preact/signals";
import { Keys } from "../../components/Keys";
import { Spoken } from "../../components/Said";
import { headOf, plural } from "../../core/format";
import { submit } from "../../core/socket";
import { connected, connection, controlWords, devicesOpen, doc, notice, now_ms, paletteOpen, people, retryAt_ms, step } from "../../core/store";
import { nextTheme, theme } from "../../core/theme";
import { JobChip } from "../jobs/Jobs";

export function StatusBar() {
  const names = people.value.people.map((person) => person.name).join(", ");
  return (
    <footer class="status">
      <NoticeLine />
      <div class="status-facts">
        {connected.value && doc.value !== null && <span>Saved, revision {doc.value.revision}</span>}
        {controlWords.value !== "" && <span>{controlWords.value}</span>}
        {connected.value && (
          <button type="button" class="plain" title={names} aria-haspopup="dialog" onClick={() => (devicesOpen.value = true)}>
            {plural(people.value.people.length, "person", "people")} here
          </button>
        )}
        <JobChip onClick={() => (step.value = 1)} />
        <button type="button" class="plain" onClick={nextTheme}>
          Colours: {theme.value}
        </button>
        <button type="button" class="plain" onClick={() => (paletteOpen.value = true)}>
          <Keys of="Ctrl+k" /> Commands
        </button>
      </div>
    </footer>
  );
}

/** The long notice that somebody opened. */
const opened = signal("");

/** A lost connection matters more than any notice. */
function NoticeLine() {
  const { text, level, undo } = notice.value;
  const trouble = connectionTrouble();
  const words = trouble === "" ? text : level === "danger" ? `${trouble} ${text}` : trouble;
  const tone = trouble !== "" ? "danger-text" : level === "fact" ? "" : `${level}-text`;
  const isOpen = opened.value === words;
  const head = headOf(words);
  return (
    <div class="notice">
      <p role="status" title={words} class={`${tone} ${isOpen ? "opened" : ""}`}>
        <Spoken text={isOpen ? words : head} />
      </p>
      {head !== words && (
        <button
          type="button"
          class="link"
          aria-expanded={isOpen}
          onClick={() => (opened.value = isOpen ? "" : words)}
        >
          {isOpen ? "Less" : "More"}
        </button>
      )}
      {trouble !== "" && connection.value === "closed" && <RetryCount />}
      {trouble === "" && undo && (
        <button type="button" class="link" onClick={() => void submit({ type: "undo" })}>
          Undo <Keys of="Ctrl+z" />
        </button>
      )}
    </div>
  );
}

function connectionTrouble(): string {
  switch (connection.value) {
    case "open":
      return "";
    case "connecting":
      return "Connecting to the ground station.";
    case "outdated":
      return "The ground station was updated: reload the page.";
    case "closed":
      return "Not connected to the ground station; what is shown is old.";
  }
}

/** Apart from the live region, which would read out every second. */
function RetryCount() {
  const left_s = Math.max(0, Math.ceil((retryAt_ms.value - now_ms.value) / 1000));
  const when = left_s > 0 ? ` in ${left_s} s` : "";
  return <span class="quiet">Trying again{when}. A station that was started anew prints a new address.</span>;
}
