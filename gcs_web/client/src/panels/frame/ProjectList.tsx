/** The projects beside this one: opened in its place, for everybody who has the page open. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { plural } from "../../core/format";
import { send } from "../../core/socket";
import { connected, devicesOpen, projects, projectsOpen, step } from "../../core/store";
import type { ProjectEntry } from "../../core/protocol";

export function ProjectList() {
  const dialog = useRef<HTMLDivElement>(null);
  const refusal = useSignal("");
  useEffect(() => {
    void send({ type: "list_projects" });
    dialog.current?.focus();
  }, []);
  const close = (): void => {
    projectsOpen.value = false;
  };
  const open = async (folder: string): Promise<void> => {
    refusal.value = (await send({ type: "open_project", folder })).error;
    if (refusal.value === "") close();
  };
  return (
    <div
      ref={dialog}
      class="sheet-over project-list"
      role="dialog"
      aria-label="Projects"
      tabIndex={-1}
      onKeyDown={(event) => {
        if (event.key === "Escape" && !event.shiftKey) close();
      }}
    >
      <div class="block-head">
        <h2>Projects</h2>
        <button type="button" class="control" onClick={close}>
          Close
        </button>
      </div>
      <p class="quiet">Another one opens for all who have this page open; every edit is saved.</p>
      <NewProject onMade={close} />
      <ul class="list">
        {projects.value.projects.map((entry) => (
          <Entry key={entry.folder} entry={entry} onOpen={() => void open(entry.folder)} />
        ))}
      </ul>
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
      <button
        type="button"
        class="control"
        onClick={() => {
          step.value = 0;
          close();
        }}
      >
        What this project has
      </button>
      <button
        type="button"
        class="control"
        onClick={() => {
          devicesOpen.value = true;
          close();
        }}
      >
        People and devices
      </button>
    </div>
  );
}

function NewProject({ onMade }: { onMade: () => void }) {
  const name = useSignal("");
  const refusal = useSignal("");
  const make = async (): Promise<void> => {
    refusal.value = (await send({ type: "new_project", name: name.value })).error;
    if (refusal.value === "") onMade();
  };
  return (
    <form
      class="new-project"
      aria-label="New project"
      onSubmit={(event) => {
        event.preventDefault();
        void make();
      }}
    >
      <span class="field-box">
        <input
          aria-label="Name of a new project"
          placeholder="Name of a new one"
          value={name.value}
          onInput={(event) => (name.value = event.currentTarget.value)}
        />
      </span>
      <button type="submit" class="control" disabled={!connected.value || name.value.trim() === ""}>
        New project
      </button>
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
    </form>
  );
}

function Entry({ entry, onOpen }: { entry: ProjectEntry; onOpen: () => void }) {
  const { folder, name, current, trajectories, flights, problem, where } = entry;
  const place = where === "" ? folder : `in ${where}`;
  const holds = `${plural(trajectories, "trajectory", "trajectories")}, ${plural(flights, "flight", "flights")}`;
  return (
    <li>
      <div class="list-words">
        <b>{name}</b>
        <span class="quiet">{`${place}: ${problem === "" ? holds : problem}`}</span>
      </div>
      {current ? (
        <span class="quiet">open</span>
      ) : (
        <button
          type="button"
          class="link"
          disabled={!connected.value || problem !== ""}
          aria-label={`Open ${name}`}
          onClick={onOpen}
        >
          Open
        </button>
      )}
    </li>
  );
}
