/** The panels of the page, in the order of their steps: a new one is one new folder and its line here. */

import type { Panel } from "../../core/panel";
import { START } from "../start/panel";
import { MAP } from "../map/panel";
import { PLAN } from "../plan/panel";
import { FLY } from "../fly/panel";
import { COMPARE } from "../compare/panel";
import { LEARN } from "../learn/panel";

export const PANELS: readonly Panel[] = [START, MAP, PLAN, FLY, COMPARE, LEARN];
