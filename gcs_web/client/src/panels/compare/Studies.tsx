/** Over the plots of flights: how they are shown and what is taken away; and the plots that are not over time. */

import { computed } from "@preact/signals";
import { asImage, svgOf } from "../../plots/figure";
import { isLight } from "../../core/theme";
import { offered, opened } from "./flights";
import { KINDS, along, figureOf, kind, saveData, savePlot, studyProblem, xy } from "./studying";
import type { Kind } from "./studying";

const NAMES: Readonly<Record<Kind, string>> = { time: "Over time", spectrum: "Spectrum", spectrogram: "Spectrogram", xy: "x-y" };

export function KindChoice() {
  return (
    <>
      <span class="alignment" role="group" aria-label="Kind of plot">
        {KINDS.map((each) => (
          <button key={each} type="button" class="toggle" aria-pressed={kind.value === each} onClick={() => (kind.value = each)}>
            {NAMES[each]}
          </button>
        ))}
      </span>
      {kind.value === "xy" && (
        <>
          <Along axis={0} name="Stream along x" />
          <Along axis={1} name="Stream along y" />
        </>
      )}
      <SaveChoice />
    </>
  );
}

function Along({ axis, name }: { axis: 0 | 1; name: string }) {
  return (
    <select
      class="toggle stream-choice"
      aria-label={name}
      value={xy.value[axis]?.key ?? ""}
      onChange={(event) => {
        const next: [string, string] = [xy.value[0]?.key ?? "", xy.value[1]?.key ?? ""];
        next[axis] = event.currentTarget.value;
        along.value = next;
      }}
    >
      {offered.value.map(({ key, name: words, unit }) => (
        <option key={key} value={key}>
          {unit === "" ? words : `${words} (${unit})`}
        </option>
      ))}
    </select>
  );
}

export const SAVES: readonly { name: string; words: string; run: () => void }[] = [
  { name: "svg", words: "Plots as SVG", run: () => void savePlot("svg") },
  { name: "png", words: "Plots as PNG", run: () => void savePlot("png") },
  { name: "csv", words: "Data as CSV", run: () => saveData("csv") },
  { name: "parquet", words: "Data as Parquet", run: () => saveData("parquet") },
];

function SaveChoice() {
  return (
    <select
      class="toggle"
      aria-label="Save plots or data"
      value=""
      disabled={opened.value.length === 0}
      onChange={(event) => {
        SAVES.find(({ name }) => name === event.currentTarget.value)?.run();
        event.currentTarget.value = "";
      }}
    >
      <option value="">Save ...</option>
      {SAVES.map(({ name, words }) => (
        <option key={name} value={name}>
          {words}
        </option>
      ))}
    </select>
  );
}

const peaks = computed(() => {
  if (kind.value !== "spectrum") return "";
  const [curve] = figureOf("spectrum").rows[0]?.curves ?? [];
  if (curve === undefined) return "";
  const most = curve.y.reduce<number>((best, value, i) => ((value ?? 0) > (curve.y[best] ?? 0) && i > 0 ? i : best), 1);
  return `, strongest at ${(curve.x[most] ?? 0).toFixed(1)} Hz`;
});

const LEAST_PX = 120;

/** A picture: what it shows is said beside it, and its numbers are in the CSV. */
export function Study({ width, row_px }: { width: number; row_px: number }) {
  const figure = figureOf(kind.value);
  const height = Math.max(LEAST_PX * (kind.value === "xy" ? 2 : 1), row_px) * figure.rows.length + 34;
  const words = figure.rows.map(({ title }) => title).join("; ");
  return (
    <>
      {studyProblem.value !== "" && (
        <p class="caution-text" role="status">
          {studyProblem.value}
        </p>
      )}
      {figure.rows.length === 0 && studyProblem.value === "" && <p class="empty">Reading ...</p>}
      {figure.rows.length > 0 && <img
        key={String(isLight.value)}
        class="study"
        width={width}
        height={height}
        src={asImage(svgOf(figure, width, height))}
        alt={`${NAMES[kind.value]} of ${words} against ${figure.xTitle}${peaks.value}`}
      />}
    </>
  );
}
