/** A button that acts after it was held for a second; letting go earlier does nothing. */

import { useSignal } from "@preact/signals";
import { useEffect, useId, useRef } from "preact/hooks";
import { number } from "../core/format";
import { reducedMotion } from "../core/theme";

const HOLD_MS = 1000;
const STEP_MS = 40;
/** A step of a busy page counts for no more, so that a release that waits behind it is heard in time. */
const LONGEST_STEP_MS = 200;

interface Props {
  /** What holding does, as it stands after "hold to": "upload walk". */
  act: string;
  onHeld: () => void;
  disabled?: boolean;
  /** The one main button of its panel. */
  primary?: boolean;
  /** It ends a flight. */
  danger?: boolean;
  /** What is shown of `act` where there is little room. */
  short?: string;
}

export function HoldButton({ act, onHeld, disabled = false, primary = false, danger = false, short = act }: Props) {
  const held_ms = useSignal<number | null>(null);
  const timer = useRef<number | undefined>(undefined);
  const hint = useId();

  const release = (): void => {
    clearInterval(timer.current);
    held_ms.value = null;
  };
  const press = (): void => {
    if (disabled || held_ms.value !== null) return;
    let last_ms = performance.now();
    held_ms.value = 0;
    timer.current = window.setInterval(() => {
      const now_ms = performance.now();
      held_ms.value = (held_ms.value ?? 0) + Math.min(now_ms - last_ms, LONGEST_STEP_MS);
      last_ms = now_ms;
      if (held_ms.value < HOLD_MS) return;
      release();
      onHeld();
    }, STEP_MS);
  };
  useEffect(() => release, []);
  useEffect(() => {
    if (disabled) release();
  }, [disabled]);

  const isPressKey = (event: KeyboardEvent): boolean => event.key === " " || event.key === "Enter";
  const share = held_ms.value === null ? 0 : Math.min(1, held_ms.value / HOLD_MS);
  return (
    <div class="hold">
      <button
        type="button"
        class={`hold-button ${primary ? "primary" : ""} ${danger ? "danger" : ""} ${held_ms.value === null ? "" : "held"}`}
        disabled={disabled}
        aria-label={`Hold to ${act}`}
        aria-describedby={hint}
        onPointerDown={(event) => event.button === 0 && press()}
        onPointerUp={release}
        onPointerLeave={release}
        onPointerCancel={release}
        onBlur={release}
        onContextMenu={(event) => event.preventDefault()}
        onKeyDown={(event) => {
          if (!isPressKey(event)) return;
          event.preventDefault();
          if (!event.repeat) press();
        }}
        onKeyUp={(event) => isPressKey(event) && release()}
      >
        {!reducedMotion.value && <span class="hold-fill" style={{ transform: `scaleX(${share})` }} />}
        <span class="hold-words">
          {held_ms.value === null
            ? `Hold to ${short}`
            : `Keep holding: ${number((HOLD_MS * (1 - share)) / 1000, 1)} s to ${short}`}
        </span>
      </button>
      <span id={hint} class="visually-hidden">
        Hold for one second, with the pointer or the space bar. Let go to cancel; nothing is sent before.
      </span>
    </div>
  );
}
