/** What a panel of the page is made of: its folder has one, and `panels/frame/panels.ts` lists them. */

import type { ComponentType } from "preact";

export interface PageCommand {
  name: string;
  /** As `keys.ts` writes an event, e.g. "Ctrl+Shift+z"; several if one does not fit all keyboards. */
  keys?: readonly string[];
  /** Also while typing in a field. */
  everywhere?: boolean;
  /** Also while a dialog is open, unless something is typed there. */
  overDialogs?: boolean;
  enabled: () => boolean;
  run: () => void;
}

export interface Panel {
  step: number;
  name: string;
  /** None: the page is all of its cards. */
  inspector?: ComponentType;
  /** What stands left of the 3D view. */
  list?: ComponentType;
  /** What stands in the place of the 3D view. */
  cards?: ComponentType;
  /** The timeline below the 3D view. */
  drawer?: ComponentType<{ height?: number }>;
  /** Above all of the page, while it has something to ask. */
  dialog?: ComponentType;
  /** In the palette and on keys. */
  commands?: readonly PageCommand[];
}
