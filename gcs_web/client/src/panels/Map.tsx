/** The map step: how good the map is, slices and layers, edits, and background jobs. */

import { Badge } from "../components/Badge";
import { number } from "../format";
import { mapShown, step } from "../store";
import { Jobs } from "./Jobs";
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
      <div class="acts">
        <button type="button" class="control primary grow" onClick={() => (step.value = 2)}>
          Plan on this map
        </button>
      </div>
    </>
  );
}

function Facts() {
  const facts = mapShown.value?.facts;
  if (facts === undefined) {
    return (
      <section class="verdict">
        <h2>Map</h2>
        <p>The map cannot be shown; the line below says why.</p>
      </section>
    );
  }
  const { images, images_placed, reprojection_px, free_m3, standing } = facts;
  return (
    <section class="verdict">
      <div class="block-head">
        <h2>Map</h2>
        <Badge tone={standing === "doubtful" ? "caution" : "neutral"}>
          {images > 0 ? `${images_placed} of ${images} images placed` : standing}
        </Badge>
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
