/** The step Compare. */

import type { Panel } from "../../core/panel";
import { Compare } from "./Compare";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";

export const COMPARE: Panel = { step: 4, name: "Compare", inspector: Compare, list: FlightList, drawer: FlightDrawer };
