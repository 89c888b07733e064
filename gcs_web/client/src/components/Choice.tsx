/** One of several, each with a sentence. */

import { connected } from "../core/store";

interface ChoiceProps<K extends string> {
  legend: string;
  options: readonly { key: K; name: string; says: string }[];
  value: K;
  onChange: (key: K) => void;
}

export function Choice<K extends string>({ legend, options, value, onChange }: ChoiceProps<K>) {
  return (
    <fieldset class="choice" disabled={!connected.value}>
      <legend>{legend}</legend>
      {options.map(({ key, name, says }) => (
        <label key={key}>
          <input type="radio" name={legend} checked={key === value} onChange={() => onChange(key)} />
          <span>
            {name}
            <span class="quiet"> {says}</span>
          </span>
        </label>
      ))}
    </fieldset>
  );
}
