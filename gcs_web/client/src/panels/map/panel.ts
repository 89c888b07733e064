/** The step Map, and its commands. */

import type { PageCommand, Panel } from "../../core/panel";
import { connected, doc, step } from "../../core/store";
import { Map } from "./Map";
import { cancel, draft, painting } from "./editing";
import { TOOLS } from "./tools";
import "./map.css";

const COMMANDS: readonly PageCommand[] = [
  ...TOOLS.map(({ name, key, run }): PageCommand => ({
    name: `Map: ${name.toLowerCase()}`,
    keys: [key],
    enabled: () => connected.value && doc.value !== null && step.value === 1,
    run,
  })),
  { name: "Map: cancel the edit", enabled: () => step.value === 1 && (draft.value !== null || painting.value), run: cancel },
];

export const MAP: Panel = { step: 1, name: "Map", inspector: Map, commands: COMMANDS };
