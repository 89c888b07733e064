/** Effect files of the user's own are code: what a file says, and the consent without which it is not run. */

import { signal, useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { plural } from "../../core/format";
import { send } from "../../core/socket";
import { connected, effectFiles } from "../../core/store";
import type { EffectFile } from "../../core/protocol";

/** Texts that this person does not want to be asked about again; the way back is beside the parameters. */
const notNow = signal<ReadonlySet<string>>(new Set());
/** Path of a file that this person wants to see, though the vehicle does not need it. */
const looked = signal("");

const keyOf = ({ path, sha256 }: EffectFile): string => `${path}\n${sha256}`;

function waiting(): EffectFile[] {
  return effectFiles.value.filter(({ agreed, needed }) => needed && !agreed);
}

export function lookAt(path: string): void {
  looked.value = path;
}

/** The first file that nobody agreed to, over the page. */
export function EffectFileConsent() {
  const asked = effectFiles.value.find(({ path, agreed }) => path === looked.value && !agreed);
  const file = asked ?? waiting().find((each) => !notNow.value.has(keyOf(each)));
  return file === undefined || !connected.value ? null : <Question key={keyOf(file)} file={file} />;
}

function Question({ file }: { file: EffectFile }) {
  const refusal = useSignal("");
  const box = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    const opener = document.activeElement;
    box.current?.focus();
    return () => opener instanceof HTMLElement && opener.focus();
  }, []);
  const later = (): void => {
    notNow.value = new Set(notNow.value).add(keyOf(file));
    looked.value = "";
  };
  const agree = async (): Promise<void> => {
    const { error } = await send({ type: "agree_to_effect_file", path: file.path, sha256: file.sha256 });
    refusal.value = error;
  };
  return (
    <div
      class="sheet-over effect-file"
      role="dialog"
      aria-labelledby="effect-file-title"
      aria-describedby="effect-file-words"
      tabIndex={-1}
      ref={box}
      onKeyDown={(event) => event.key === "Escape" && !event.shiftKey && later()}
    >
      <h2 id="effect-file-title">
        {file.problem === "" ? "Run this file?" : "This file cannot be run"} <span class="file-name">{file.name}</span>
      </h2>
      <p id="effect-file-words" class={file.problem === "" ? "" : "caution-text"}>
        {words(file)}
      </p>
      <dl class="file-facts">
        <dt class="quiet">Path</dt>
        <dd>{file.path}</dd>
        <dt class="quiet">SHA-256</dt>
        <dd>{file.sha256 || "–"}</dd>
      </dl>
      {file.problem === "" && (
        <pre tabIndex={0} aria-label={`Text of ${file.name}`}>
          {file.text}
        </pre>
      )}
      <p class="refusal" role="alert">
        {refusal}
      </p>
      <div class="acts">
        <button type="button" class="control" onClick={later}>
          {file.problem === "" ? "Not now" : "Close"}
        </button>
        {file.problem === "" && (
          <button type="button" class="control primary" disabled={!connected.value} onClick={() => void agree()}>
            Run {file.name}
          </button>
        )}
      </div>
    </div>
  );
}

function words(file: EffectFile): string {
  const named = file.needed ? "The vehicle file names it as an effect" : "It is an effect to be tried";
  if (file.problem !== "") return `${named}, but ${file.problem}.`;
  const why = file.changed ? "It was changed since somebody agreed to it" : named;
  const until = file.needed ? "nothing of it runs and nothing is planned with this vehicle" : "nothing of it runs";
  return (
    `${why}. It is a program, and it runs on the station's machine with all that its user may do. Read it first. Until ` +
    `somebody agrees, ${until}; a changed file asks again.`
  );
}

/** One line for who said "not now". */
export function EffectFilesWaiting() {
  const files = waiting();
  if (files.length === 0) return null;
  return (
    <section class="block">
      <p class="caution-text">
        {plural(files.length, "effect file waits", "effect files wait")} for somebody to agree:{" "}
        {files.map(({ name }) => name).join(", ")}
      </p>
      <button type="button" class="control" onClick={() => (notNow.value = new Set())}>
        Look at {files.length === 1 ? "it" : "them"}
      </button>
    </section>
  );
}
