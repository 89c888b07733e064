/** A number with its name and unit: Enter or leaving accepts, Escape restores, a refusal stands below. */

import { useSignal } from "@preact/signals";
import { useId } from "preact/hooks";
import { editable, parse } from "../core/format";

interface Props {
  label: string;
  unit: string;
  /** Null where nothing is asked. */
  value: number | null;
  /** What is committed for an empty field; without it, a number is wanted. */
  empty?: number | undefined;
  /** Returns the sentence of a refusal, empty when it was taken. */
  onCommit: (value: number) => Promise<string>;
  disabled?: boolean;
}

export function NumberField({ label, unit, value, empty, onCommit, disabled = false }: Props) {
  const id = useId();
  const text = useSignal<string | null>(null);
  const refusal = useSignal("");

  const restore = (): void => {
    text.value = null;
    refusal.value = "";
  };
  const commit = async (): Promise<void> => {
    if (text.value === null || text.value === editable(value)) return restore();
    const typed = text.value.trim() === "" && empty !== undefined ? empty : parse(text.value);
    if (typed === null) {
      refusal.value = `“${text.value}” is not a number; type one in ${unit}, like ${editable(value ?? 1.5)}`;
      return;
    }
    refusal.value = await onCommit(typed);
    if (refusal.value === "") text.value = null;
  };
  return (
    <div class="field">
      <label for={id}>{label}</label>
      <span class={`field-box ${refusal.value === "" ? "" : "refused"}`}>
        <input
          id={id}
          inputMode="decimal"
          autoComplete="off"
          disabled={disabled}
          value={text.value ?? editable(value)}
          aria-invalid={refusal.value !== ""}
          aria-describedby={refusal.value === "" ? undefined : `${id}-refusal`}
          onInput={(event) => (text.value = event.currentTarget.value)}
          onBlur={() => void commit()}
          onKeyDown={(event) => {
            if (event.key === "Enter") void commit();
            if (event.key === "Escape") restore();
          }}
        />
        <span class="unit">{unit}</span>
      </span>
      {refusal.value !== "" && (
        <p id={`${id}-refusal`} class="refusal">
          {refusal.value}
        </p>
      )}
    </div>
  );
}
