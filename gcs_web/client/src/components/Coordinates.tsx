/** Numbers in a row, each with the name of its axis: Enter or leaving accepts, Escape restores. */

import { useSignal } from "@preact/signals";
import { editable, parse } from "../core/format";

interface Props {
  label: string;
  axes: readonly string[];
  values: readonly number[];
  disabled?: boolean;
  onChange: (values: number[]) => void;
}

export function Coordinates({ label, axes, values, disabled = false, onChange }: Props) {
  return (
    <div class="coordinates" role="group" aria-label={label}>
      <span class="quiet">{label}</span>
      <div class="coordinate-row">
        {axes.map((axis, i) => (
          <Cell
            key={axis}
            label={`${label} ${axis}`}
            axis={axis}
            value={values[i] ?? 0}
            disabled={disabled}
            onChange={(value) => onChange(values.map((old, k) => (k === i ? value : old)))}
          />
        ))}
      </div>
    </div>
  );
}

interface CellProps {
  label: string;
  axis: string;
  value: number;
  disabled: boolean;
  onChange: (value: number) => void;
}

function Cell({ label, axis, value, disabled, onChange }: CellProps) {
  const text = useSignal<string | null>(null);
  const typed = text.value === null ? value : parse(text.value);
  const commit = (): void => {
    if (typed === null) return; // stays there, marked, until it is a number or Escape is pressed
    text.value = null;
    if (typed !== value) onChange(typed);
  };
  return (
    <label class={`field-box ${typed === null ? "refused" : ""}`}>
      <span class="unit">{axis}</span>
      <input
        aria-label={label}
        aria-invalid={typed === null}
        inputMode="decimal"
        autoComplete="off"
        disabled={disabled}
        value={text.value ?? editable(value)}
        onInput={(event) => (text.value = event.currentTarget.value)}
        onBlur={commit}
        onKeyDown={(event) => {
          if (event.key === "Enter") {
            event.preventDefault(); // accepts the number; the form is for its button
            commit();
          }
          if (event.key === "Escape") text.value = null;
        }}
      />
    </label>
  );
}
