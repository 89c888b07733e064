/** The saved trajectories of the project. */

import { Badge } from "../components/Badge";
import { dayAndTime, number } from "../format";
import { submit } from "../socket";
import { connected, files } from "../store";

export function Trajectories() {
  const saved = files.value.trajectories;
  if (saved.length === 0) return <p class="empty">No trajectories yet. Save a checked plan.</p>;
  return (
    <ul class="list">
      {saved.map(({ name, duration_s, checked, saved_at }) => (
        <li key={name}>
          <div class="list-words">
            <b>{name}</b>
            <span class="quiet">
              {number(duration_s, 2)} s, saved {dayAndTime(saved_at)}
            </span>
          </div>
          <Badge tone={checked ? "neutral" : "caution"}>{checked ? "Checked" : "Not checked"}</Badge>
          <button
            type="button"
            class="link"
            disabled={!connected.value}
            aria-label={`Open ${name}`}
            onClick={() => void submit({ type: "open", name })}
          >
            Open
          </button>
          <button
            type="button"
            class="link"
            disabled={!connected.value}
            aria-label={`Discard ${name}`}
            title="Moves it into the project's bin"
            onClick={() => void submit({ type: "discard", name })}
          >
            Discard
          </button>
        </li>
      ))}
    </ul>
  );
}
