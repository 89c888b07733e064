/** The step Learn. */

import type { Panel } from "../../core/panel";
import { EffectFileConsent } from "./EffectFiles";
import { Learn } from "./Learn";
import { ModelInspector, Versions } from "./Model";
import "./learn.css";

export const LEARN: Panel = {
  step: 5,
  name: "Learn",
  inspector: ModelInspector,
  list: Versions,
  cards: Learn,
  dialog: EffectFileConsent,
};
