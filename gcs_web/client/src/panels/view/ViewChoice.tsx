/** Over the scene: from where it is looked at. */

import { Keys } from "../../components/Keys";
import { OFFERED, isLoaded, look } from "./view";
import { canDraw } from "../../core/machine";

const NONE = "no WebGL here";

export function ViewChoice() {
  return (
    <div class="view-choice" role="toolbar" aria-label="View">
      {OFFERED.map(({ key, name, letter, enabled, run }) => (
        <button key={key} type="button" aria-pressed={look.value === key} disabled={!enabled()} title={canDraw ? "" : NONE} onClick={run}>
          {name} <Keys of={letter} />
        </button>
      ))}
      {!canDraw && <span class="quiet">{NONE}</span>}
      {canDraw && look.value !== "top" && !isLoaded.value && <span class="quiet">loading</span>}
    </div>
  );
}
