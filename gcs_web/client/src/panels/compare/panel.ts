/** The step Compare, and its command. */

import type { PageCommand, Panel } from "../../core/panel";
import { step } from "../../core/store";
import { Compare } from "./Compare";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";
import { open, togglePlaying } from "./flights";

const STEP = 4;

const PLAY: PageCommand = {
  name: "Play or pause the flights",
  keys: ["Space", "k"],
  enabled: () => step.value === STEP && open.value.length > 0,
  run: togglePlaying,
};

export const COMPARE: Panel = {
  step: STEP,
  name: "Compare",
  inspector: Compare,
  list: FlightList,
  drawer: FlightDrawer,
  commands: [PLAY],
};
