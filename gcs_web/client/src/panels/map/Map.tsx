/** The map step: how good the map is, slices and layers, edits, and background jobs. */

import { Badge } from "../../components/Badge";
import { submit } from "../../core/socket";
import { number } from "../../core/format";
import { connected, files, jobs, mapShown, step } from "../../core/store";
import { Jobs, chosenKind } from "../jobs/Jobs";
import { MapButtons } from "../start/Buttons";
import { MapEdits } from "./MapEdits";
import { Layers, Slices } from "./Slices";

export function Map() {
  return (
    <>
      <Facts />
      <Slices />
      <Layers />
      <MapEdits />
      <Jobs />
      <div class="spring" />
      <div class="acts rows">
        {files.value.has_map && <FormButton kind="map" name="Import images" />}
        {mapShown.value !== null && <FormButton kind="look_again" name="Where to look again" />}
        {files.value.has_map && (
          <button type="button" class="control primary grow" onClick={() => (step.value = 2)}>
            Plan on this map
          </button>
        )}
      </div>
    </>
  );
}

/** Opens the form of a job; nothing where the station does not offer it. */
function FormButton({ kind, name }: { kind: string; name: string }) {
  if (!jobs.value.kinds.some((each) => each.name === kind)) return null;
  const open = (): void => {
    void submit({ type: "list_jobs" }); // files may have come since
    chosenKind.value = kind;
  };
  return (
    <button type="button" class="control" disabled={!connected.value} onClick={open}>
      {name}
    </button>
  );
}

function Facts() {
  const facts = mapShown.value?.facts;
  if (facts === undefined) {
    return (
      <section class="verdict">
        <h2>Map</h2>
        <p>
          {files.value.has_map
            ? "The map cannot be shown; the line below says why."
            : "None yet. Compare and Learn need no map."}
        </p>
        {!files.value.has_map && (
          <div class="fill">
            <MapButtons />
          </div>
        )}
      </section>
    );
  }
  const { images, images_placed, reprojection_px, free_m3, standing } = facts;
  return (
    <section class="verdict">
      <div class="block-head">
        <h2>Map</h2>
        {images > 0 && (
          <Badge tone={standing === "doubtful" ? "caution" : "neutral"}>
            {images_placed} of {images} images placed
          </Badge>
        )}
      </div>
      <dl class="map-facts">
        <div>
          <dt>Reprojection</dt>
          <dd>
            {number(reprojection_px, 2)} <span class="unit">px</span>
          </dd>
        </div>
        <div>
          <dt>Proven free</dt>
          <dd>
            {number(free_m3, 1)} <span class="unit">m³</span>
          </dd>
        </div>
        <div>
          <dt>Verdict</dt>
          <dd>{standing}</dd>
        </div>
      </dl>
    </section>
  );
}
