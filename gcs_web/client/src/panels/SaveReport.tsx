/** The comparison or the diagnosis as one offline HTML file: made in the background, then downloaded. */

import { connected, jobs } from "../store";
import { JobRows } from "./Jobs";
import { isRunning, startOnFlights } from "./WhereItFails";

export function SaveReport({ of }: { of: "comparison" | "diagnosis" }) {
  const kind = `${of}_report`;
  const made = jobs.value.jobs.some((job) => job.kind === kind && job.state === "done");
  return (
    <section class="card" aria-label={`Report of the ${of}`}>
      <div class="block-head">
        <span class="dim">The {of} as one HTML file that needs no network.</span>
        <span class="acts-row">
          {made && (
            <a class="link" href={`/report?name=${of}`} download>
              Download the report
            </a>
          )}
          <button
            type="button"
            class="control"
            disabled={!connected.value || isRunning(kind)}
            onClick={() => void startOnFlights(kind)}
          >
            Save as report
          </button>
        </span>
      </div>
      {isRunning(kind) && <JobRows kinds={[kind]} />}
    </section>
  );
}
