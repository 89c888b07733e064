/** The page: which panel stands where. */

import type { ComponentType } from "preact";
import { saveFormOpen } from "./actions";
import { Palette } from "./components/Palette";
import { Resizer, drawerHeight } from "./components/Resizer";
import { Compare } from "./panels/Compare";
import { Drawer } from "./panels/Drawer";
import { EffectFileConsent } from "./panels/EffectFiles";
import { FlightDrawer } from "./panels/FlightDrawer";
import { FlightList } from "./panels/FlightList";
import { Fly } from "./panels/Fly";
import { Learn } from "./panels/Learn";
import { Map } from "./panels/Map";
import { ModelInspector, Versions } from "./panels/Model";
import { Plan } from "./panels/Plan";
import { ProjectList } from "./panels/ProjectList";
import { SaveForm } from "./panels/SaveForm";
import { Scene } from "./panels/Scene";
import { StatusBar } from "./panels/StatusBar";
import { TopBar } from "./panels/TopBar";
import { connected, paletteOpen, projectsOpen, step } from "./store";
import { phone } from "./theme";

interface Panels {
  inspector: ComponentType;
  /** What stands left of the 3D view. */
  list?: ComponentType;
  /** What stands in the place of the 3D view. */
  cards?: ComponentType;
  /** The timeline below the 3D view. */
  drawer?: ComponentType<{ height?: number }>;
}

const PLAN: Panels = { inspector: Plan, drawer: Drawer };
const PANELS: Readonly<Record<number, Panels>> = {
  1: { inspector: Map },
  2: PLAN,
  3: { inspector: Fly, drawer: Drawer },
  4: { inspector: Compare, list: FlightList, drawer: FlightDrawer },
  5: { inspector: ModelInspector, list: Versions, cards: Learn },
};

export function App() {
  const panel = PANELS[step.value] ?? PLAN;
  const { inspector: Inspector, list: List, cards: Cards, drawer: Below } = panel;
  const isPhone = phone.value;
  const hasDrawer = Below !== undefined && !isPhone;
  const height = drawerHeight(step.value);
  const kinds = ["app", connected.value ? "" : "stale", List === undefined ? "" : "with-list"];
  if (Cards !== undefined) kinds.push("without-scene");
  return (
    <div class={kinds.join(" ")} style={{ "--drawer": hasDrawer ? `${height}px` : "0px" }}>
      <TopBar />
      {List !== undefined && !isPhone && <div class="list-area">{<List />}</div>}
      {Cards === undefined && <Scene />}
      {Cards !== undefined && !isPhone && <Cards />}
      {hasDrawer && (
        <section class="drawer-area" aria-label="Timeline">
          <Resizer step={step.value} />
          <Below height={height} />
        </section>
      )}
      <aside key={step.value} class="inspector" aria-label="Inspector">
        {isPhone && Cards !== undefined && <Cards />}
        <Inspector />
        {isPhone && Cards !== undefined && List !== undefined && <List />}
      </aside>
      <StatusBar />
      {paletteOpen.value && <Palette />}
      {saveFormOpen.value && <SaveForm />}
      <EffectFileConsent />
      {projectsOpen.value && <ProjectList />}
    </div>
  );
}
