/** A limit of the plan: share used, value, bound, and the moment it happens. */

import { number, sentenceCase, short } from "../../core/format";
import { goTo } from "./cursor";
import type { Limit } from "../../core/protocol";

const SHARE_THAT_BINDS = 0.95;

export function LimitRow({ limit }: { limit: Limit }) {
  const share = Math.min(1, Math.max(0, limit.share));
  const kind = limit.share > 1.0005 ? "exceeded" : limit.share > SHARE_THAT_BINDS ? "binds" : "";
  return (
    <li class={`limit ${kind}`}>
      <span class="limit-name">
        {sentenceCase(limit.name)}
        {kind === "exceeded" && <span class="danger-text"> exceeded</span>}
      </span>
      <span class="share" role="img" aria-label={`${Math.round(100 * limit.share)} % of the limit used`}>
        <span class="share-fill" style={{ width: `${100 * share}%` }} />
      </span>
      <span class="limit-value">{short(limit.value)}</span>
      <span class="limit-bound">
        {limit.sense === "<=" ? "≤" : "≥"} {short(limit.bound)} {limit.unit}
      </span>
      <button
        type="button"
        class="link"
        onClick={() => goTo(limit.time_s)}
        aria-label={`${limit.name}: show ${number(limit.time_s, 2)} s`}
      >
        {number(limit.time_s, 2)} s
      </button>
    </li>
  );
}

/** Those of which more than 95 % is used come first, then by share. */
export function LimitList({ limits, areOld }: { limits: readonly Limit[]; areOld: boolean }) {
  const sorted = [...limits].sort((a, b) => b.share - a.share);
  return (
    <section class="block" aria-labelledby="limits-title">
      <div class="block-head">
        <h3 id="limits-title">Limits that bind</h3>
        <span class="quiet">{areOld ? "of the plan before" : "share of limit used"}</span>
      </div>
      <ul class={`limits ${areOld ? "old" : ""}`}>
        {sorted.map((limit) => (
          <LimitRow key={limit.name} limit={limit} />
        ))}
      </ul>
    </section>
  );
}
