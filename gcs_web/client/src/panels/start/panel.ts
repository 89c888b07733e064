/** Where an empty project is filled: a page of its own before the steps. */

import type { Panel } from "../../core/panel";
import { Start } from "./Start";
import { START_STEP } from "./fill";
import "./start.css";

export const START: Panel = { step: START_STEP, name: "Start", cards: Start };
