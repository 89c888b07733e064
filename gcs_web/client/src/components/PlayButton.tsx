/** Starts and stops the time that a drawer plays. */

import { Icon } from "./Icon";

export function PlayButton({ playing, onClick }: { playing: boolean; onClick: () => void }) {
  return (
    <button type="button" class="control square" onClick={onClick} aria-label={playing ? "Pause" : "Play"}>
      <Icon name={playing ? "pause" : "play"} filled={!playing} />
    </button>
  );
}
