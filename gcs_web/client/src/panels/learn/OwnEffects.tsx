/** Effects of the user's own: drafted from a curve that no known effect explains, read, agreed to and tried. */

import { useSignal } from "@preact/signals";
import { submit } from "../../core/socket";
import { connected, effectFiles, model } from "../../core/store";
import type { DraftEffect, EffectFile } from "../../core/protocol";
import { lookAt } from "./EffectFiles";
import { isRunning, startOnFlights } from "../compare/WhereItFails";

const FORMS: Record<EffectForm, string> = {
  equation: "the equation",
  spline: "spline, nine knots",
  polynomial: "polynomial, a cubic",
};
type EffectForm = DraftEffect["form"];

/** The name and form for an effect of what was diagnosed; the first form is chosen to begin with. */
export function MakeEffect({ effect, forms, isCurrent }: { effect: string; forms: EffectForm[]; isCurrent: boolean }) {
  const name = useSignal(effect);
  const form = useSignal(forms[0] ?? "spline");
  return (
    <form
      class="card-foot own-effect"
      onSubmit={(event) => {
        event.preventDefault();
        void submit({ type: "draft_effect", name: name.value.trim(), form: form.value });
      }}
    >
      <label>
        <span class="quiet">Name of the effect</span>
        <input
          autoComplete="off"
          spellcheck={false}
          value={name.value}
          onInput={(event) => (name.value = event.currentTarget.value)}
        />
      </label>
      <label>
        <span class="quiet">Function</span>
        <select
          value={form.value}
          onChange={(event) => (form.value = forms[event.currentTarget.selectedIndex] ?? form.value)}
        >
          {forms.map((each) => (
            <option key={each} value={each}>
              {FORMS[each]}
            </option>
          ))}
        </select>
      </label>
      <button type="submit" class="control" disabled={!connected.value || !isCurrent || name.value.trim() === ""}>
        Make an effect of it
      </button>
    </form>
  );
}

/** Files of the project's folder `effects` that the vehicle does not have. */
export function OwnEffects() {
  const files = effectFiles.value.filter(({ needed }) => !needed);
  if (files.length === 0) return null;
  return (
    <section class="card" aria-label="Effects of your own">
      <h3>Effects of your own</h3>
      <p class="dim">
        Python files in the folder effects. A drawn curve is a measurement, not an explanation: when you know the cause,
        put its law in place of the curve.
      </p>
      {files.map((file) => (
        <Row key={file.path} file={file} />
      ))}
    </section>
  );
}

function Row({ file }: { file: EffectFile }) {
  const isTried = model.value?.tried?.effect === file.name.replace(/\.py$/, "");
  return (
    <div class="acts-row">
      <span>
        <b>{file.name}</b>{" "}
        <span class="quiet">
          {file.problem !== "" ? file.problem : file.agreed ? "agreed to" : file.changed ? "changed since it was agreed to" : "not read yet"}
        </span>
      </span>
      {file.agreed ? (
        <button
          type="button"
          class="control"
          disabled={!connected.value || isTried || isRunning("try_effect")}
          onClick={() => void startOnFlights("try_effect", { effect: file.name })}
        >
          Try: refit with it
        </button>
      ) : (
        <button type="button" class="control" aria-label={`Read ${file.name}`} onClick={() => lookAt(file.path)}>
          Read
        </button>
      )}
    </div>
  );
}
