/** The map step's state: what is shown of the map, what is measured, and the edit that is being drawn. */

import { effect, signal } from "@preact/signals";
import { edit, latest, submit } from "../../core/socket";
import { announce, doc, mapPreview, mapShown, measured, welcome } from "../../core/store";
import type { MapEdit, MapShown, Shape, Slice } from "../../core/protocol";

export type Layer = MapShown["layers"][number];
export type Form = Exclude<Shape["form"], "other" | "stroke">;
type Action = MapEdit["action"];

/** An edit of the map before it is made. */
export interface Draft {
  /** Id of the edit that it would replace; null for a new one. */
  edit: number | null;
  /** Of the document that it was begun with: what others made of the same edit since then is not overwritten. */
  revision: number;
  action: Action;
  name: string;
  shape: Shape;
}

export const draft = signal<Draft | null>(null);
export const draftRefusal = signal("");
/** Whether drags over the mesh paint. */
export const painting = signal(false);

export const ACTIONS: readonly { key: Action; name: string; says: string }[] = [
  { key: "no-fly", name: "No-fly zone", says: "counts as an obstacle; nothing else frees it" },
  { key: "add", name: "Obstacle", says: "something that the map lacks" },
  { key: "clear", name: "Clear", says: "mapped obstacles that are not there; unknown space stays unknown" },
];
export const ACTION_NAMES: Readonly<Record<Action, string>> = {
  "no-fly": "No-fly",
  add: "Obstacle",
  clear: "Clear",
  remove: "Declared free",
};

// --- what is shown ---

const sendShown = latest(({ slice, layers }: { slice: Slice | null; layers: Layer[] }) => ({
  type: "show_map",
  slice,
  layers,
}));

export function showMap(change: { slice?: Slice | null; layers?: Layer[] }): void {
  const now = mapShown.value;
  if (now === null) return;
  mapShown.value = { ...now, ...change };
  sendShown(mapShown.value);
}

export function toggleLayer(layer: Layer): void {
  const layers = mapShown.value?.layers ?? [];
  showMap({ layers: layers.includes(layer) ? layers.filter((each) => each !== layer) : [...layers, layer] });
}

export function toggleMeasuring(): void {
  void submit({ type: "measure", active: !measured.value.active });
}

// --- drawing an edit ---

const sendPreview = latest((wanted: Draft | null) => ({
  type: "preview_map_edit",
  action: wanted?.action ?? "no-fly",
  shape: wanted?.shape ?? null,
  edit: wanted?.edit ?? null,
}));

const BRUSH_M = 0.2;

/** Begin to paint: drags over the mesh become strokes, and the last one a draft. */
export async function beginStroke(): Promise<void> {
  const { action = "no-fly" } = draft.value ?? {};
  cancel();
  if (await submit({ type: "paint", active: true, action, radius_m: BRUSH_M })) painting.value = true;
}

/** Begin a new edit: at the measured point or in the middle of the map, a metre large. */
export function begin(form: Form): void {
  const shown = mapShown.value;
  if (shown === null) return;
  const [x, y, z] = measured.value.points_m.at(-1) ?? middle(shown.low_m, shown.high_m);
  const shape: Shape = {
    form,
    centre_m: [x, y, z],
    size_m: [1, 1, 1],
    radius_m: 0.5,
    corners_m: [
      [x - 0.5, y - 0.5],
      [x + 0.5, y - 0.5],
      [x + 0.5, y + 0.5],
      [x - 0.5, y + 0.5],
    ],
    points_m: [],
  };
  const { action = "no-fly", name = "" } = draft.value ?? {};
  setDraft({ edit: null, revision: revisionNow(), action, name, shape });
}

export function open({ id, action, name, shape }: MapEdit): void {
  setDraft({ edit: id, revision: revisionNow(), action, name, shape });
}

const revisionNow = (): number => doc.value?.revision ?? 0;

export function change(part: Partial<Draft>): void {
  if (draft.value !== null) setDraft({ ...draft.value, ...part });
}

export function reshape(part: Partial<Shape>): void {
  if (draft.value !== null) change({ shape: { ...draft.value.shape, ...part } });
}

function setDraft(next: Draft): void {
  draft.value = next;
  draftRefusal.value = "";
  if (next.shape.form !== "other") sendPreview(next);
}

export function cancel(): void {
  draft.value = null;
  draftRefusal.value = "";
  if (painting.value) {
    painting.value = false;
    void submit({ type: "paint", active: false });
  } else {
    sendPreview(null);
  }
}

export async function apply(): Promise<void> {
  const wanted = draft.value;
  if (wanted === null) return;
  const { action, name, revision } = wanted;
  const shape = wanted.shape.form === "other" ? null : wanted.shape;
  const { error } =
    wanted.edit === null
      ? await edit({ type: "add_map_edit", action, name, shape: wanted.shape })
      : await edit({ type: "change_map_edit", edit: wanted.edit, action, name, shape }, revision);
  draftRefusal.value = error;
  if (error === "") cancel();
}

export async function drop(id: number): Promise<void> {
  const { error } = await edit({ type: "drop_map_edits", edits: [id] });
  if (error !== "") announce(error, "danger");
  else if (draft.value?.edit === id) cancel();
}

/** A handle in the 3D view was pulled, or the brush painted: the numbers follow. What was typed meanwhile stays. */
effect(() => {
  const { author, shape, edit: number, drawn } = mapPreview.value;
  if (!drawn) return;
  const now = draft.peek();
  if (author === welcome.peek()?.you && shape?.form === "stroke" && number === null && painting.peek()) {
    const { action, name } = now ?? { action: "no-fly" as const, name: "" };
    draft.value = { edit: null, revision: revisionNow(), action, name, shape };
    return;
  }
  if (author !== welcome.peek()?.you || shape === null || now === null || now.edit !== number) return;
  if (now.shape.form === shape.form) draft.value = { ...now, shape };
});

/** An edit that was dropped by somebody is no longer being changed. */
effect(() => {
  const listed = doc.value?.map_edits;
  const number = draft.peek()?.edit ?? null;
  if (number !== null && listed?.every(({ id }) => id !== number) === true) cancel();
});

type Vector = [number, number, number];

function middle(low: Vector, high: Vector): Vector {
  const half = (a: number, b: number): number => Number(((a + b) / 2).toFixed(2));
  return [half(low[0], high[0]), half(low[1], high[1]), half(low[2], high[2])];
}
