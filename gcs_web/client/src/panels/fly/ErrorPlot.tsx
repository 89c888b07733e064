/** How far the vehicle was from its set-point over the last minute. */

import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type uPlot from "uplot";
import { drawErrors } from "../../plots/plots";
import { errors } from "../../core/store";
import { isLight } from "../../core/theme";

const HEIGHT_PX = 96;

export function ErrorPlot() {
  const target = useRef<HTMLDivElement>(null);
  const plot = useSignal<uPlot | null>(null);
  const isThemeLight = isLight.value;
  useEffect(() => {
    if (target.current === null) return undefined;
    const drawn = drawErrors(target.current, target.current.clientWidth, HEIGHT_PX);
    plot.value = drawn;
    return () => {
      plot.value = null;
      drawn.destroy();
    };
  }, [isThemeLight]);
  useSignalEffect(() => {
    const heard = errors.value;
    const last_ms = heard.at(-1)?.heardAt_ms ?? 0;
    const ago_s = heard.map(({ heardAt_ms }) => (heardAt_ms - last_ms) / 1000);
    plot.value?.setData([ago_s, heard.map(({ error_m }) => 1000 * error_m)]);
  });
  return (
    <section class="block" aria-labelledby="error-title">
      <div class="block-head">
        <h3 id="error-title">Tracking error</h3>
        <span class="quiet">mm, last minute heard</span>
      </div>
      <div
        ref={target}
        class="error-plot"
        role="img"
        aria-label="Tracking error over the last minute, in millimetres"
      />
    </section>
  );
}
