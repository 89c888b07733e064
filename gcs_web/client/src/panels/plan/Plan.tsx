/** The plan step: verdict, waypoints, segments, speed, mission and saved trajectories, limits, save and upload. */

import { signal } from "@preact/signals";
import { canUpload, openUpload, uploading } from "../fly/orders";
import { canSave, saveFormOpen } from "./actions";
import { Keys } from "../../components/Keys";
import { LimitList } from "../timeline/LimitRow";
import { Tabs } from "../../components/Tabs";
import type { Tab } from "../../components/Tabs";
import { figures, figuresAreOld, hasVehicle, verdict } from "../../core/store";
import { phone } from "../../core/theme";
import { Drawer } from "../timeline/Drawer";
import { Mission } from "./Mission";
import { Segments } from "./Segments";
import { SettingsForm } from "./SettingsForm";
import { Trajectories } from "./Trajectories";
import { LinkButtons } from "../start/Buttons";
import { PreflightBlock } from "../fly/Preflight";
import { UploadPanel } from "../fly/UploadPanel";
import { Verdict } from "./Verdict";
import { Waypoints } from "./Waypoints";

const TABS = [
  { key: "waypoints", name: "Waypoints" },
  { key: "segments", name: "Segments" },
  { key: "settings", name: "Speed" },
  { key: "mission", name: "Mission" },
  { key: "trajectories", name: "Saved" },
] as const satisfies readonly Tab<string>[];

const tab = signal<(typeof TABS)[number]["key"]>("waypoints");

export function Plan() {
  if (uploading.value !== null) return <UploadPanel state={uploading.value} />;
  const limits = figures.value?.limits ?? [];
  return (
    <>
      <Verdict />
      <PreflightBlock />
      {phone.value && <Drawer />}
      <Tabs label="Plan" tabs={TABS} current={tab.value} onChange={(key) => (tab.value = key)}>
        {tab.value === "waypoints" && <Waypoints />}
        {tab.value === "segments" && <Segments />}
        {tab.value === "settings" && <SettingsForm />}
        {tab.value === "mission" && <Mission />}
        {tab.value === "trajectories" && <Trajectories />}
      </Tabs>
      {limits.length > 0 && <LimitList limits={limits} areOld={figuresAreOld.value} />}
      <div class="acts">
        <button type="button" class="control" disabled={!canSave()} onClick={() => (saveFormOpen.value = true)}>
          Save <Keys of="Ctrl+s" />
        </button>
        <button
          type="button"
          class="control primary grow"
          disabled={!canUpload.value}
          title={whyNoUpload()}
          onClick={openUpload}
        >
          Compare and upload
        </button>
        {verdict.value === "checked" && !hasVehicle.value && (
          <>
            <p class="quiet">{NO_VEHICLE}</p>
            <LinkButtons />
          </>
        )}
      </div>
    </>
  );
}

const NO_VEHICLE = "No vehicle is connected: save the plan, or connect one.";

function whyNoUpload(): string {
  if (!hasVehicle.value) return NO_VEHICLE;
  return verdict.value === "checked" ? "" : "Only a checked plan can be uploaded.";
}
