/** The edits of the map: the list, and the one that is being drawn. */

import { Coordinates } from "../../components/Coordinates";
import { number, plural } from "../../core/format";
import {
  ACTIONS,
  ACTION_NAMES,
  apply,
  cancel,
  change,
  draft,
  draftRefusal,
  drop,
  open,
  painting,
  reshape,
} from "./editing";
import type { Draft } from "./editing";
import { connected, doc, mapPreview } from "../../core/store";
import type { MapEdit } from "../../core/protocol";

const XYZ = ["x", "y", "z"] as const;

export function MapEdits() {
  const listed = doc.value?.map_edits ?? [];
  const isNew = draft.value !== null && draft.value.edit === null;
  return (
    <section class="block" aria-labelledby="map-edits-title">
      <div class="block-head">
        <h3 id="map-edits-title">Edits</h3>
        <span class="quiet">applied over the map, all undoable</span>
      </div>
      {listed.length === 0 && !isNew && (
        <p class="quiet">None. Draw a box, a prism, a sphere or a stroke with the tools over the 3D view.</p>
      )}
      {painting.value && (
        <p class="quiet" role="status">
          Drag over the mesh to draw a stroke; a drag beside it turns the view. Another drag begins anew.
        </p>
      )}
      {listed.length > 0 && (
        <ol class="map-edits">
          {listed.map((each, i) => (
            <Row key={each.id} edit={each} place={i + 1} />
          ))}
        </ol>
      )}
      {draft.value !== null && <DraftForm wanted={draft.value} />}
    </section>
  );
}

function Row({ edit, place }: { edit: MapEdit; place: number }) {
  const isOpen = draft.value?.edit === edit.id;
  const name = edit.name === "" ? ACTION_NAMES[edit.action] : `${ACTION_NAMES[edit.action]}: ${edit.name}`;
  return (
    <li>
      <button
        type="button"
        class="map-edit"
        aria-pressed={isOpen}
        disabled={!connected.value}
        onClick={() => (isOpen ? cancel() : open(edit))}
      >
        <span class="quiet">{place}</span>
        <b>{name}</b>
        <span class="quiet">{edit.words}</span>
      </button>
    </li>
  );
}

function DraftForm({ wanted }: { wanted: Draft }) {
  const { shape, action, edit } = wanted;
  const off = !connected.value;
  return (
    <form
      class="map-draft"
      aria-label={edit === null ? "New edit of the map" : "Edit of the map"}
      onSubmit={(event) => {
        event.preventDefault();
        void apply();
      }}
    >
      <div class="field long">
        <label for="map-edit-action">What it does</label>
        <span class="field-box">
          <select
            id="map-edit-action"
            value={action}
            disabled={off}
            onChange={(event) => change({ action: event.currentTarget.value as MapEdit["action"] })}
          >
            {ACTIONS.map(({ key, name }) => (
              <option key={key} value={key}>
                {name}
              </option>
            ))}
            {action === "remove" && <option value="remove">{ACTION_NAMES.remove}</option>}
          </select>
        </span>
      </div>
      <p class="quiet">{ACTIONS.find(({ key }) => key === action)?.says ?? "you vouch that it is free"}</p>
      <div class="field long">
        <label for="map-edit-name">Name</label>
        <span class="field-box">
          <input
            id="map-edit-name"
            class="words"
            maxLength={60}
            autoComplete="off"
            placeholder={action === "no-fly" ? "needed" : ""}
            value={wanted.name}
            disabled={off}
            onInput={(event) => change({ name: event.currentTarget.value })}
          />
        </span>
      </div>
      <Numbers wanted={wanted} off={off} />
      {shape.form === "other" ? (
        <p class="quiet">Made with goshawk map edit: its shape is changed there.</p>
      ) : (
        <Effect />
      )}
      {draftRefusal.value !== "" && (
        <p class="refusal" role="alert">
          {draftRefusal.value}
        </p>
      )}
      <div class="acts-row">
        {edit !== null && (
          <button type="button" class="control" disabled={off} onClick={() => void drop(edit)}>
            Drop
          </button>
        )}
        <button type="button" class="control" onClick={cancel}>
          Cancel
        </button>
        <button type="submit" class="control grow strong" disabled={off}>
          {edit === null ? "Add to the map" : "Apply"}
        </button>
      </div>
    </form>
  );
}

function Numbers({ wanted, off }: { wanted: Draft; off: boolean }) {
  const { form, centre_m, size_m, radius_m, corners_m } = wanted.shape;
  const [x, y, z] = centre_m;
  if (form === "other") return null;
  const radius = (
    <Coordinates
      label="Radius, m"
      axes={["r"]}
      values={[radius_m]}
      disabled={off}
      onChange={([r = 0]) => reshape({ radius_m: r })}
    />
  );
  if (form === "stroke") return radius;
  if (form === "prism") {
    return (
      <>
        {corners_m.map((corner, i) => (
          <div class="corner" key={i}>
            <Coordinates
              label={`Corner ${i + 1}, m`}
              axes={["x", "y"]}
              values={corner}
              disabled={off}
              onChange={([cx = 0, cy = 0]) =>
                reshape({ corners_m: corners_m.map((old, k) => (k === i ? [cx, cy] : old)) })
              }
            />
            <button
              type="button"
              class="control square"
              aria-label={`Remove corner ${i + 1}`}
              disabled={off || corners_m.length <= 3}
              onClick={() => reshape({ corners_m: corners_m.filter((_, k) => k !== i) })}
            >
              −
            </button>
          </div>
        ))}
        <button type="button" class="control" disabled={off} onClick={() => reshape({ corners_m: split(corners_m) })}>
          Add a corner
        </button>
        <Coordinates
          label="Heights, m"
          axes={["from", "to"]}
          values={[z - size_m[2] / 2, z + size_m[2] / 2]}
          disabled={off}
          onChange={([low = 0, high = 0]) =>
            reshape({ centre_m: [x, y, (low + high) / 2], size_m: [size_m[0], size_m[1], high - low] })
          }
        />
      </>
    );
  }
  return (
    <>
      <Coordinates
        label="Centre, m"
        axes={XYZ}
        values={centre_m}
        disabled={off}
        onChange={([cx = 0, cy = 0, cz = 0]) => reshape({ centre_m: [cx, cy, cz] })}
      />
      {form === "sphere" ? (
        radius
      ) : (
        <Coordinates
          label="Size, m"
          axes={XYZ}
          values={size_m}
          disabled={off}
          onChange={([sx = 0, sy = 0, sz = 0]) => reshape({ size_m: [sx, sy, sz] })}
        />
      )}
    </>
  );
}

/** A corner more, in the middle of the last edge. */
function split(corners: readonly [number, number][]): [number, number][] {
  const first = corners[0];
  const last = corners.at(-1);
  if (first === undefined || last === undefined) return [...corners];
  return [...corners, [(first[0] + last[0]) / 2, (first[1] + last[1]) / 2]];
}

/** What it would change, before it is made. */
function Effect() {
  const { closed_m3, opened_m3, voxels, shape } = mapPreview.value;
  if (shape === null) return null;
  const parts = [
    closed_m3 > 0 ? `${number(closed_m3, 2)} m³ no longer free` : "",
    opened_m3 > 0 ? `${number(opened_m3, 2)} m³ newly free` : "",
  ].filter((part) => part !== "");
  return (
    <p class="quiet" role="status">
      {voxels === 0 ? "Changes nothing in the map." : `${parts.join(", ")} (${plural(voxels, "voxel", "voxels")}). `}
      {voxels > 0 && "Every plan becomes void and is checked again."}
    </p>
  );
}
