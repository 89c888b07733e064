/** A drawing of `scatter.ts` as wide as its place; a click gives the value of x there. */

import { useLayoutEffect, useRef } from "preact/hooks";
import { draw } from "./scatter";
import type { Drawing, Frame } from "./scatter";
import { isLight } from "../core/theme";
import { useWidth } from "./width";

interface Props {
  what: Drawing;
  height: number;
  /** What it shows, in words. */
  label: string;
  onPick?: (x: number) => void;
}

export function ScatterPlot({ what, height, label, onPick }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const frame = useRef<Frame | null>(null);
  const width = useWidth(box);
  const isThemeLight = isLight.value;
  useLayoutEffect(() => {
    if (canvas.current !== null && width.value > 80) frame.current = draw(canvas.current, what, width.value, height);
  }, [what, height, width.value, isThemeLight]);
  return (
    <div
      ref={box}
      class={`scatter ${onPick === undefined ? "" : "picks"}`}
      onClick={(event) => {
        const at = frame.current;
        if (onPick === undefined || at === null) return;
        const left = event.currentTarget.getBoundingClientRect().left;
        onPick(at.x[0] + ((event.clientX - left - at.left) / at.width) * (at.x[1] - at.x[0]));
      }}
    >
      <canvas ref={canvas} role="img" aria-label={label} />
    </div>
  );
}
