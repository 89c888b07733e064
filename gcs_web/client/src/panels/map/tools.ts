/** The tools of the step Map, for the toolbar, the keys and the palette. */

import { begin, beginStroke, cancel, draft, painting, toggleMeasuring } from "./editing";
import type { Form } from "./editing";
import { measured } from "../../core/store";

export interface Tool {
  name: string;
  key: string;
  active: () => boolean;
  run: () => void;
}

const drawing = (form: Form): boolean => draft.value?.shape.form === form;

function shapeTool(name: string, key: string, form: Form): Tool {
  return { name, key, active: () => drawing(form), run: () => (drawing(form) ? cancel() : begin(form)) };
}

export const TOOLS: readonly Tool[] = [
  shapeTool("Box", "b", "box"),
  shapeTool("Prism", "r", "prism"),
  shapeTool("Sphere", "o", "sphere"),
  { name: "Brush", key: "h", active: () => painting.value, run: () => (painting.value ? cancel() : void beginStroke()) },
  { name: "Measure", key: "m", active: () => measured.value.active, run: toggleMeasuring },
];
