/** The page: which panel stands where. */

import { Palette } from "./panels/frame/Palette";
import { Resizer, drawerHeight } from "./components/Resizer";
import { Devices } from "./panels/frame/Devices";
import { FlightBar } from "./panels/frame/FlightBar";
import { PANELS } from "./panels/frame/panels";
import { PLAN } from "./panels/plan/panel";
import { ProjectList } from "./panels/frame/ProjectList";
import { Scene } from "./panels/frame/Scene";
import { StatusBar } from "./panels/frame/StatusBar";
import { TopBar } from "./panels/frame/TopBar";
import { connected, devicesOpen, paletteOpen, projectsOpen, step } from "./core/store";
import { phone } from "./core/theme";

export function App() {
  const shown = PANELS.find((panel) => panel.step === step.value) ?? PLAN;
  const { inspector: Inspector, list: List, cards: Cards, drawer: Below } = shown;
  const isPhone = phone.value;
  const hasDrawer = Below !== undefined && !isPhone;
  const height = drawerHeight(step.value);
  const kinds = ["app", connected.value ? "" : "stale", List === undefined ? "" : "with-list"];
  if (Cards !== undefined) kinds.push("without-scene");
  if (Inspector === undefined) kinds.push("whole");
  return (
    <div class={kinds.join(" ")} style={{ "--drawer": hasDrawer ? `${height}px` : "0px" }}>
      <TopBar />
      {List !== undefined && !isPhone && <div class="list-area">{<List />}</div>}
      {Cards === undefined && <Scene />}
      {Cards !== undefined && (!isPhone || Inspector === undefined) && <Cards />}
      {hasDrawer && (
        <section class="drawer-area" aria-label="Timeline">
          <Resizer step={step.value} />
          <Below height={height} />
        </section>
      )}
      {Inspector !== undefined && (
        <aside key={step.value} class="inspector" aria-label="Inspector">
          {isPhone && Cards !== undefined && <Cards />}
          <Inspector />
          {isPhone && Cards !== undefined && List !== undefined && <List />}
        </aside>
      )}
      <FlightBar />
      <StatusBar />
      {paletteOpen.value && <Palette />}
      {PANELS.map(({ step, dialog: Dialog }) => Dialog !== undefined && <Dialog key={step} />)}
      {projectsOpen.value && <ProjectList />}
      {devicesOpen.value && <Devices />}
    </div>
  );
}
