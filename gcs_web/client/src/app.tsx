/** The page: which panel stands where. */

import type { ComponentType } from "preact";
import { saveFormOpen } from "./panels/plan/actions";
import { Palette } from "./panels/frame/Palette";
import { Resizer, drawerHeight } from "./components/Resizer";
import { Compare } from "./panels/compare/Compare";
import { Drawer } from "./panels/plan/Drawer";
import { EffectFileConsent } from "./panels/learn/EffectFiles";
import { FlightDrawer } from "./panels/compare/FlightDrawer";
import { FlightList } from "./panels/compare/FlightList";
import { Fly } from "./panels/fly/Fly";
import { Learn } from "./panels/learn/Learn";
import { Map } from "./panels/map/Map";
import { ModelInspector, Versions } from "./panels/learn/Model";
import { Plan } from "./panels/plan/Plan";
import { ProjectList } from "./panels/frame/ProjectList";
import { SaveForm } from "./panels/plan/SaveForm";
import { Scene } from "./panels/frame/Scene";
import { StatusBar } from "./panels/frame/StatusBar";
import { TopBar } from "./panels/frame/TopBar";
import { connected, paletteOpen, projectsOpen, step } from "./core/store";
import { phone } from "./core/theme";

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
