/** A button that lets a person choose files of this computer. */

import { connected } from "../core/store";

interface Props {
  name: string;
  kinds: readonly string[];
  primary?: boolean;
  onFile: (file: File) => void;
}

export function FileButton({ name, kinds, primary = false, onFile }: Props) {
  return (
    <label class={`control import ${primary ? "primary" : ""}`}>
      {name}
      <input
        class="visually-hidden"
        type="file"
        multiple
        accept={kinds.join(",")}
        disabled={!connected.value}
        onChange={(event) => {
          for (const file of event.currentTarget.files ?? []) onFile(file);
          event.currentTarget.value = "";
        }}
      />
    </label>
  );
}
