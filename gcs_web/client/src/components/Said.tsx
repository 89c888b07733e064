/** A sentence of the station: the commands in it (between backticks) set as code, a long one folded behind its head. */

import { useSignal } from "@preact/signals";
import { headOf } from "../core/format";

/** All of a sentence. */
export function Spoken({ text }: { text: string }) {
  return <>{text.split("`").map((part, at) => (at % 2 === 1 ? <code key={at}>{part}</code> : part))}</>;
}

export function Said({ text }: { text: string }) {
  const open = useSignal(false);
  const head = headOf(text);
  return (
    <>
      <Spoken text={open.value ? text : head} />
      {head !== text && (
        <>
          {" "}
          <button
            type="button"
            class="link small"
            aria-expanded={open.value}
            onClick={() => (open.value = !open.value)}
          >
            {open.value ? "Less" : "More"}
          </button>
        </>
      )}
    </>
  );
}
