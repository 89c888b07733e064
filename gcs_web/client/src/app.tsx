/** The page: which panel stands where. */

import type { ComponentType } from "preact";
import { saveFormOpen } from "./actions";
import { Palette } from "./components/Palette";
import { Resizer, drawerHeight } from "./components/Resizer";
import { Drawer } from "./panels/Drawer";
import { Fly } from "./panels/Fly";
import { Later } from "./panels/Later";
import { Map } from "./panels/Map";
import { Plan } from "./panels/Plan";
import { SaveForm } from "./panels/SaveForm";
import { Scene } from "./panels/Scene";
import { StatusBar } from "./panels/StatusBar";
import { TopBar } from "./panels/TopBar";
import { connected, paletteOpen, step } from "./store";
import { phone } from "./theme";

/** The inspector of each step, and whether the timeline stands below the 3D view. */
const PANELS: Readonly<Record<number, { inspector: ComponentType; hasDrawer: boolean }>> = {
  1: { inspector: Map, hasDrawer: false },
  2: { inspector: Plan, hasDrawer: true },
  3: { inspector: Fly, hasDrawer: true },
};

export function App() {
  const panel = PANELS[step.value];
  const Inspector = panel?.inspector;
  const hasDrawer = panel?.hasDrawer === true && !phone.value;
  const height = drawerHeight(step.value);
  return (
    <div class={`app ${connected.value ? "" : "stale"}`} style={{ "--drawer": hasDrawer ? `${height}px` : "0px" }}>
      <TopBar />
      <Scene />
      {hasDrawer && (
        <section class="drawer-area" aria-label="Timeline">
          <Resizer step={step.value} />
          <Drawer height={height} />
        </section>
      )}
      <aside key={step.value} class="inspector" aria-label="Inspector">
        {Inspector === undefined ? <Later step={step.value} /> : <Inspector />}
      </aside>
      <StatusBar />
      {paletteOpen.value && <Palette />}
      {saveFormOpen.value && <SaveForm />}
    </div>
  );
}
