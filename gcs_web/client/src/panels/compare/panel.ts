/** The step Compare, and its command. */

import type { PageCommand, Panel } from "../../core/panel";
import { step } from "../../core/store";
import { Compare } from "./Compare";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";
import { open, togglePlaying } from "./flights";
import { SAVES } from "./Studies";
import { nextKind } from "./studying";

const STEP = 4;

const PLAY: PageCommand = {
  name: "Play or pause the flights",
  keys: ["Space", "k"],
  enabled: () => isComparing(),
  run: togglePlaying,
};

const isComparing = (): boolean => step.value === STEP && open.value.length > 0;

const STUDY: PageCommand = { name: "Flights over time, as spectrum, x-y", keys: ["x"], enabled: isComparing, run: nextKind };
const SAVE: readonly PageCommand[] = SAVES.map(({ words, run }) => ({ name: `Save: ${words}`, enabled: isComparing, run }));

export const COMPARE: Panel = {
  step: STEP,
  name: "Compare",
  inspector: Compare,
  list: FlightList,
  drawer: FlightDrawer,
  commands: [PLAY, STUDY, ...SAVE],
};
