/** A stream that somebody writes: a formula of the log's columns. */

import { signal, useSignal } from "@preact/signals";
import { addFormula } from "./flights";

/** The choice that opens the form. */
export const FORMULA = "formula";
/** Whether somebody writes a formula. */
export const writing = signal(false);

/** A stream of one's own: a formula of the log's columns. */
export function FormulaForm() {
  const text = useSignal("");
  const refusal = useSignal("");
  if (!writing.value) return null;
  return (
    <form
      class="formula"
      onSubmit={(event) => {
        event.preventDefault();
        void addFormula(text.value).then((error) => {
          refusal.value = error;
          if (error === "") writing.value = false;
        });
      }}
    >
      <label>
        <span class="visually-hidden">Formula of the log's columns</span>
        <input
          autoFocus
          spellcheck={false}
          maxLength={200}
          placeholder="hypot(position_world_x_m, position_world_y_m)"
          value={text.value}
          onInput={(event) => (text.value = event.currentTarget.value)}
        />
      </label>
      <button type="submit" class="control">
        Draw
      </button>
      <button type="button" class="link" onClick={() => (writing.value = false)}>
        Cancel
      </button>
      {refusal.value !== "" && (
        <p class="refusal" role="alert">
          {refusal.value}
        </p>
      )}
    </form>
  );
}
