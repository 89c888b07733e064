/** The saved trajectories of the project: opened, compared, shared, discarded, and taken out of the bin. */

import { Badge } from "../../components/Badge";
import { dayAndTime, number } from "../../core/format";
import { submit } from "../../core/socket";
import { connected, files, verdict } from "../../core/store";
import { ComparePlans, compared } from "./ComparePlans";
import type { SavedTrajectory } from "../../core/protocol";

export function Trajectories() {
  const { trajectories } = files.value;
  return (
    <div class="table-scroll">
      {trajectories.length === 0 && <p class="empty">No trajectories yet. Save a checked plan.</p>}
      <ul class="list">
        {trajectories.map((saved) => (
          <Saved key={saved.name} saved={saved} />
        ))}
      </ul>
      {verdict.value === "checked" && (
        <p class="list-foot">
          <a class="link" href="/share" download>
            Share this plan as one HTML file
          </a>
        </p>
      )}
      <ComparePlans />
      <Bin />
    </div>
  );
}

function Saved({ saved }: { saved: SavedTrajectory }) {
  const { name, duration_s, checked, saved_at } = saved;
  return (
    <li class="saved">
      <div class="list-words">
        <b>{name}</b>
        <span class="quiet">
          {number(duration_s, 2)} s, saved {dayAndTime(saved_at)}
        </span>
      </div>
      <Badge tone={checked ? "neutral" : "caution"}>{checked ? "Checked" : "Not checked"}</Badge>
      <div class="list-acts">
        <Act of={name} name="Open" onClick={() => void submit({ type: "open", name })} />
        <Act of={name} name="Compare" onClick={() => (compared.value = [otherThan(name), name])} />
        <a class="link" href={`/share?name=${encodeURIComponent(name)}`} download aria-label={`Share ${name}`}>
          Share
        </a>
        <Act
          of={name}
          name="Discard"
          title="Moves it into the project's bin"
          onClick={() => void submit({ type: "discard", name })}
        />
      </div>
    </li>
  );
}

/** What a trajectory is compared with first: the plan, if there is one. */
function otherThan(name: string): string {
  if (verdict.value === "checked") return "";
  return files.value.trajectories.find((each) => each.name !== name)?.name ?? name;
}

interface ActProps {
  of: string;
  name: string;
  title?: string;
  onClick: () => void;
}

function Act({ of, name, title = "", onClick }: ActProps) {
  return (
    <button
      type="button"
      class="link"
      disabled={!connected.value}
      aria-label={`${name} ${of}`}
      title={title}
      onClick={onClick}
    >
      {name}
    </button>
  );
}

function Bin() {
  const { bin } = files.value;
  if (bin.length === 0) return null;
  return (
    <details class="bin">
      <summary>Bin ({bin.length})</summary>
      <p class="quiet">Discarded or replaced; kept in the project until you delete the files yourself.</p>
      <ul class="list">
        {bin.map(({ file, name, duration_s, moved_at }) => (
          <li key={file}>
            <div class="list-words">
              <b>{name}</b>
              <span class="quiet">
                {duration_s > 0 ? `${number(duration_s, 2)} s, ` : ""}
                {dayAndTime(moved_at)}
              </span>
            </div>
            <Act of={file} name="Restore" onClick={() => void submit({ type: "restore", file })} />
          </li>
        ))}
      </ul>
    </details>
  );
}
