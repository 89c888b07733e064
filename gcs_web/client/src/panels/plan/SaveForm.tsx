/** Asks for the name under which the plan is saved. */

import { useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { canSave, saveFormOpen } from "./actions";
import { send } from "../../core/socket";
import { files, plan } from "../../core/store";

export function SaveForm() {
  const name = useSignal(plan.value?.name ?? "");
  const refusal = useSignal("");
  const input = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => {
    const opener = document.activeElement;
    input.current?.select();
    return () => opener instanceof HTMLElement && opener.focus();
  }, []);

  const close = (): void => {
    saveFormOpen.value = false;
  };
  const save = async (overwrite: boolean): Promise<void> => {
    const { error } = await send({ type: "save", name: name.value.trim(), overwrite });
    refusal.value = error;
    if (error === "") close();
  };
  const exists = files.value.trajectories.some((saved) => saved.name === name.value.trim());
  return (
    <div
      class="sheet-over save-form"
      role="dialog"
      aria-labelledby="save-title"
      onKeyDown={(event) => event.key === "Escape" && !event.shiftKey && close()}
    >
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void save(false);
        }}
      >
        <h2 id="save-title">Save the trajectory</h2>
        <div class="field">
          <label for="save-name">Name</label>
          <span class={`field-box ${refusal.value === "" ? "" : "refused"}`}>
            <input
              id="save-name"
              ref={input}
              autoComplete="off"
              value={name.value}
              aria-invalid={refusal.value !== ""}
              aria-describedby="save-refusal"
              onInput={(event) => {
                name.value = event.currentTarget.value;
                refusal.value = "";
              }}
            />
          </span>
          <p id="save-refusal" class="refusal" role="alert">
            {refusal.value}
          </p>
        </div>
        <div class="acts">
          <button type="button" class="control" onClick={close}>
            Cancel
          </button>
          {refusal.value !== "" && exists && (
            <button type="button" class="control" disabled={!canSave()} onClick={() => void save(true)}>
              Overwrite
            </button>
          )}
          <button type="submit" class="control primary grow" disabled={!canSave() || name.value.trim() === ""}>
            Save
          </button>
        </div>
      </form>
    </div>
  );
}
