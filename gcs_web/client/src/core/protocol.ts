// Written by tools/page_types.py from the structs of gcs_web. Do not edit.


export const PROTOCOL = 10;

export interface Abort {
  type: "abort";
  serial: number;
}

export interface AddMapEdit {
  type: "add_map_edit";
  serial: number;
  revision: number;
  action: "add" | "no-fly" | "clear" | "remove";
  name: string;
  shape: Shape;
}

export interface AgreeToEffectFile {
  type: "agree_to_effect_file";
  serial: number;
  path: string;
  sha256: string;
}

export interface AlignFlights {
  type: "align_flights";
  serial: number;
  flights: string[];
  by: "trajectory" | "take_off" | "motion" | "speed" | "height";
}

export interface Aligned {
  flight: string;
  by_s: number | null;
  words: string;
}

export interface ArmingCheck {
  name: string;
  passed: boolean;
  finding: string;
  remedy: string;
}

export interface ArrowScale {
  force_n_per_m: number;
  torque_n_m_per_m: number;
}

export interface Aside {
  file: string;
  name: string;
  duration_s: number;
  moved_at: string;
}

export interface Ask {
  type: "ask";
  serial: number;
  revision: number;
  waypoints: number[];
  stay_s?: number | null;
  fly_by_m?: number | null;
  leg_speed_m_s?: number | null;
  leg_jerk_m_s3?: number | null;
}

export interface Attempt {
  name: string;
  title: string;
  outcome: string;
  sentence: string;
}

export interface CancelJob {
  type: "cancel_job";
  serial: number;
  job: number;
}

export interface Candidate {
  name: string;
  title: string;
  verdict: "present" | "useful proxy" | "inconclusive" | "excluded";
  reason: string;
  probability: number;
  law: string;
  sizes: EffectSize[];
  error_mm: number;
  confounded: Confounded[];
  outlook: string;
  evidence: Evidence | null;
}

export interface ChangeMapEdit {
  type: "change_map_edit";
  serial: number;
  revision: number;
  edit: number;
  action?: "add" | "no-fly" | "clear" | "remove" | null;
  name?: string | null;
  shape?: Shape | null;
}

export interface ChannelResidual {
  channel: string;
  unit: string;
  rms: number;
  shares: number[];
}

export interface Choose {
  type: "choose";
  serial: number;
  revision: number;
  speed_m_s?: number | null;
  acceleration_m_s2?: number | null;
  jerk_m_s3?: number | null;
  margin_m?: number | null;
  yaw?: "along_path" | "smooth" | "steady" | "fixed" | "look_at" | "free" | null;
  method?: "fastest" | "corridor" | null;
  heading_deg?: number | null;
  look_at_m?: [number, number, number] | null;
}

export interface ClearGate {
  type: "clear_gate";
  serial: number;
  revision: number;
  waypoint: number;
}

export interface ClearGround {
  type: "clear_ground";
  serial: number;
  revision: number;
  end: "take_off" | "landing";
}

export interface ColumnGuess {
  name: string;
  columns: string[];
  reasons: string[];
}

export interface Command {
  serial: number;
}

export interface ComparePlans {
  type: "compare_plans";
  serial: number;
  names: string[];
}

export interface Comparison {
  type: "comparison";
  state: "none" | "current" | "old";
  learn: string[];
  held_out: string[];
  judged_how: string;
  variables: VariableName[];
  channels: ChannelResidual[];
  horizons_s: number[];
  errors: HorizonError[];
  predictions: number;
  remarks: string[];
  has_report: boolean;
}

export interface Compensation {
  vehicle: string;
  version: number;
  parameters: ControllerParameter[];
  not_compensated: NotCompensated[];
  mark: string;
}

export interface Confounded {
  name: string;
  title: string;
  share: number;
}

export interface ConfoundedPair {
  first: string;
  second: string;
  correlation: number;
}

export interface Connect {
  type: "connect";
  serial: number;
  url: string;
  poses?: string;
}

export interface ControllerParameter {
  name: string;
  unit: string;
  flies_with: number;
  model: number;
  in_flight: boolean;
}

export interface Cursor {
  type: "cursor";
  time_s: number;
}

export interface CurvePart {
  label: string;
  kind: "measured" | "plan" | "model" | "residual";
  values: (number | null)[];
}

export interface Delete {
  type: "delete";
  serial: number;
  revision: number;
  waypoints: number[];
}

export interface Diagnosis {
  type: "diagnosis";
  state: "none" | "current" | "old";
  verdict: string;
  probability: number;
  probabilities: string;
  envelope: string;
  fit: string;
  learn: string[];
  held_out: string[];
  candidates: Candidate[];
  attempts: Attempt[];
  horizons: string[];
  staircase: Stair[];
  outside: OutsideCurve | null;
  equation: ProposedEquation | null;
  unobservable: string[];
  findings: string[];
  left: string[];
  vehicle: string;
  logs: string;
  has_report: boolean;
}

export interface Discard {
  type: "discard";
  serial: number;
  name: string;
}

export interface DiscardFlight {
  type: "discard_flight";
  serial: number;
  flight: string;
}

export interface Document {
  type: "document";
  revision: number;
  author: string;
  waypoints: Waypoint[];
  settings: Settings;
  mission: Mission;
  map_edits: MapEdit[];
  undo: string;
  redo: string;
}

export interface Draft {
  type: "draft";
  waypoint: number | null;
  sentence: string;
  state: "clear" | "too close" | "refused" | "checked";
}

export interface DraftEffect {
  type: "draft_effect";
  serial: number;
  name: string;
  form: "equation" | "spline" | "polynomial";
}

export interface DrawPlainly {
  type: "draw_plainly";
  serial: number;
  view: string;
  triangles: number;
}

export interface DropMapEdits {
  type: "drop_map_edits";
  serial: number;
  revision: number;
  edits: number[];
}

export interface DropPath {
  type: "drop_path";
  serial: number;
}

export interface DropTried {
  type: "drop_tried";
  serial: number;
}

export interface Edit {
  serial: number;
  revision: number;
}

export interface EffectFile {
  name: string;
  path: string;
  sha256: string;
  text: string;
  needed: boolean;
  agreed: boolean;
  changed: boolean;
  problem: string;
}

export interface EffectFiles {
  type: "effect_files";
  files: EffectFile[];
}

export interface EffectSize {
  name: string;
  unit: string;
  value: number;
  sigma: number;
  low: number;
  high: number;
  excluded_above: number;
  smallest_visible: number;
  usual: number;
}

export interface EndInvitation {
  type: "end_invitation";
  serial: number;
}

export interface Evidence {
  channel: string;
  unit: string;
  variable: VariableName;
  x: number[];
  y: number[];
  effect_x: number[];
  effect_y: number[];
  held_x: number[];
  held_before: number[];
  held_after: number[];
}

export interface Failsafe {
  whose: string;
  when: string;
  act: string;
}

export interface Files {
  type: "files";
  trajectories: SavedTrajectory[];
  flights: string[];
  bin: Aside[];
  has_map: boolean;
  has_vehicle: boolean;
}

export interface Finding {
  level: "warning" | "error";
  sentence: string;
  fix: string;
  fixable: boolean;
  spans_s: [number, number][];
  what: string;
}

export interface FixFlight {
  type: "fix_flight";
  serial: number;
  flight: string;
  only?: string;
}

export interface FlightCard {
  name: string;
  state: "reading" | "ready" | "unreadable";
  role: "learn" | "hold_out" | "leave";
  note: string;
  sentence: string;
  recorded_at: string;
  vehicle_said: string;
  trajectory: string;
  duration_s: number;
  rows: number;
  tracking_mean_m: number | null;
  tracking_worst_m: number | null;
  path_m: number[];
  findings: Finding[];
  inconclusive: string[];
  notes: string[];
  fixed: string[];
}

export interface FlightMoment {
  type: "flight_moment";
  time_s: number;
}

export interface Flights {
  type: "flights";
  flights: FlightCard[];
}

export interface FlightsShown {
  type: "flights_shown";
  author: string;
  flights: string[];
  arrows: ArrowScale | null;
  colour_reach: number | null;
  plan_too: boolean;
}

export interface Follow {
  type: "follow";
  serial: number;
  view: string;
  following: boolean;
}

export interface Foreign {
  firmware: string;
  failsafes: Failsafe[];
  can_pause: boolean;
  kill: string;
}

export interface ForeseeJob {
  type: "foresee_job";
  serial: number;
  kind: string;
  arguments: Record<string, string | number | boolean | string[]>;
}

export interface ForgetJob {
  type: "forget_job";
  serial: number;
  job: number;
}

export interface FoundVehicle {
  url: string;
  system: number;
}

export interface Gate {
  width_m: number;
  height_m: number;
  heading_deg: number;
  pitch_deg: number;
  roll_deg: number;
}

export interface GiveUpControl {
  type: "give_up_control";
  serial: number;
}

export interface Ground {
  x_m: number;
  y_m: number;
  z_m: number;
  climb_m_s: number;
}

export interface Held {
  name: string;
  duration_s: number;
  segments: number;
  room_m: number;
  crc32: string;
}

export interface HorizonError {
  quantity: string;
  unit: string;
  values: number[];
}

export interface Identification {
  type: "identification";
  state: "none" | "current" | "old";
  verdict: string;
  reasons: string[];
  flights: string[];
  parameters: Identified[];
  free: string[];
  correlation: number[][];
  confounded: ConfoundedPair[];
  trials: Trial[];
  written: string[];
  vehicle: string;
  logs: string;
}

export interface Identified {
  name: string;
  words: string;
  unit: string;
  start: number;
  value: number;
  sigma: number;
  status: string;
}

export interface Incoming {
  name: string;
  column_map: string;
  guesses: ColumnGuess[];
  unused: string[];
}

export interface Insert {
  type: "insert";
  serial: number;
  revision: number;
  after: number | null;
  x_m?: number | null;
  y_m?: number | null;
  z_m?: number | null;
}

export interface Invitation {
  address: string;
  code: string[];
  only_here: boolean;
  good_s: number;
}

export interface InvitationEnded {
  type: "invitation_ended";
  number: number;
}

export interface Invite {
  type: "invite";
  serial: number;
}

export interface Job {
  id: number;
  kind: string;
  title: string;
  state: "waiting" | "running" | "done" | "failed" | "cancelled";
  author: string;
  stage: string;
  share: number;
  left_s: number | null;
  elapsed_s: number;
  words: string;
}

export interface JobField {
  name: string;
  title: string;
  says: string;
  form: "text" | "choice" | "several" | "number" | "integer" | "flag";
  default: string | number | boolean | string[];
  choices: string[];
  unit: string;
}

export interface JobKind {
  name: string;
  title: string;
  fields: JobField[];
}

export interface Jobs {
  type: "jobs";
  jobs: Job[];
  kinds: JobKind[];
}

export interface Keep {
  type: "keep";
  serial: number;
  vehicle_hash: string;
}

export interface Kill {
  type: "kill";
  serial: number;
}

export interface Limit {
  name: string;
  value: number;
  bound: number;
  sense: "<=" | ">=";
  unit: string;
  share: number;
  time_s: number;
}

export interface ListFlights {
  type: "list_flights";
  serial: number;
}

export interface ListJobs {
  type: "list_jobs";
  serial: number;
}

export interface ListProjects {
  type: "list_projects";
  serial: number;
}

export interface Look {
  type: "look";
  serial: number;
  time_s: number | null;
}

export interface LookAtFlight {
  type: "look_at_flight";
  serial: number;
  time_s: number | null;
}

export interface LookAtVehicle {
  type: "look_at_vehicle";
  serial: number;
}

export interface LookForVehicles {
  type: "look_for_vehicles";
  serial: number;
}

export interface Loop {
  type: "loop";
  serial: number;
  revision: number;
  laps: number;
  lap_first?: number | null;
  lap_last?: number | null;
}

export interface LostLinkAct {
  after_s: number;
  act: string;
}

export interface MapEdit {
  id: number;
  action: "add" | "no-fly" | "clear" | "remove";
  name: string;
  shape: Shape;
  words: string;
}

export interface MapFacts {
  images: number;
  images_placed: number;
  reprojection_px: number | null;
  free_m3: number;
  standing: string;
  doubt: string;
  hash: string;
}

export interface MapPreview {
  type: "map_preview";
  author: string;
  edit: number | null;
  shape: Shape | null;
  closed_m3: number;
  opened_m3: number;
  voxels: number;
  drawn: boolean;
}

export interface MapSection {
  type: "map_section";
  image: string;
  low_m: [number, number];
  high_m: [number, number];
  at_m: number;
  of: "distance" | "unknown" | "could_hide" | "surface_std" | null;
}

export interface MapShown {
  type: "map_shown";
  slice: Slice | null;
  layers: ("mesh" | "cameras" | "points" | "edits" | "axes" | "heights")[];
  low_m: [number, number, number];
  high_m: [number, number, number];
  facts: MapFacts;
  author: string;
}

export interface Measure {
  type: "measure";
  serial: number;
  active: boolean;
}

export interface Measured {
  type: "measured";
  active: boolean;
  points_m: [number, number, number][];
  clearances_m: (number | null)[];
  distance_m: number | null;
}

export interface Mission {
  laps: number;
  lap_first: number | null;
  lap_last: number | null;
  take_off: Ground | null;
  landing: Ground | null;
  keep_in_m: number | null;
  keep_in_recorded: boolean;
}

export interface Model {
  type: "model";
  name: string;
  titles: string[];
  effects: string[];
  parameters: ParameterRow[];
  versions: VehicleVersion[];
  tried: Tried | null;
}

export interface Move {
  type: "move";
  serial: number;
  revision: number;
  waypoints: number[];
  x_m?: number | null;
  y_m?: number | null;
  z_m?: number | null;
}

export interface NewProject {
  type: "new_project";
  serial: number;
  name: string;
}

export interface NextFlight {
  type: "next_flight";
  state: "none" | "current" | "old";
  refusal: string;
  name: string;
  manoeuvre: string;
  candidates: string[];
  size: number;
  heading_rad: number;
  duration_s: number;
  top_speed_m_s: number;
  clearance_m: number;
  required_clearance_m: number;
  known_log_odds: number;
  expected_log_odds: number;
  needed_log_odds: number;
  path_m: number[];
  section: Section | null;
  learn: string[];
  held_out: string[];
  vehicle: string;
  logs: string;
  map: string;
}

export interface NotCompensated {
  title: string;
  why: string;
}

export interface Notice {
  type: "notice";
  text: string;
  level: "fact" | "caution" | "danger";
  undo: boolean;
}

export interface Open {
  type: "open";
  serial: number;
  name: string;
}

export interface OpenFlights {
  type: "open_flights";
  serial: number;
  flights: string[];
  formulas?: string[];
}

export interface OpenProject {
  type: "open_project";
  serial: number;
  folder: string;
}

export interface OpenedFlight {
  name: string;
  start_s: number;
  end_s: number;
  shift_s: number;
  streams: Stream[];
  left_out: string[];
}

export interface Order {
  type: "order";
  serial: number;
  order: "arm" | "start" | "pause" | "resume" | "land" | "disarm";
  nonce: string;
  crc32?: string;
}

export interface OutsideCurve {
  channel: string;
  words: string;
  unit: string;
  variable: VariableName;
  x: number[];
  y: number[];
  band: number[];
  probability: number;
  effect: string;
  advice: string;
}

export interface Paint {
  type: "paint";
  serial: number;
  active: boolean;
  action?: "add" | "no-fly" | "clear" | "remove";
  radius_m?: number;
}

export interface Pairs {
  flight: string;
  time_s: number[];
  x: number[];
  y: number[];
}

export interface ParameterRow {
  name: string;
  words: string;
  value: number;
  sigma: number;
  unit: string;
  source: string;
}

export interface Pass {
  type: "pass";
  serial: number;
  revision: number;
  waypoints: number[];
  velocity_m_s: [number, number, number] | null;
}

export interface Passing {
  waypoint: number | null;
  time_s: number;
  speed_m_s: number;
  clearance_m: number;
}

export interface People {
  type: "people";
  people: Person[];
  in_control: string;
}

export interface Person {
  id: string;
  name: string;
  here: boolean;
}

export interface Plan {
  type: "plan";
  revision: number;
  state: "none" | "planning" | "checked" | "refused" | "void";
  sentence: string;
  name: string;
  problem: Problem | null;
  duration_s: number;
  top_speed_m_s: number;
  clearance_m: number;
  required_clearance_m: number;
  closest: [number, number, number] | null;
  planning_ms: number;
  crc32: string;
  limits: Limit[];
  segments: Segment[];
  passings: Passing[];
  series: Series | null;
}

export interface PlanAgain {
  type: "plan_again";
  serial: number;
}

export interface PlanSummary {
  name: string;
  passes: boolean;
  failures: string[];
  duration_s: number;
  length_m: number;
  top_speed_m_s: number;
  limits: Limit[];
}

export interface Preflight {
  type: "preflight";
  state: "none" | "current" | "stale";
  stale: string;
  verdict: "go" | "no_go" | "not_shown";
  sentence: string;
  decides: string;
  remedy: string;
  flights: number;
  wind_m_s: number;
  assumed: string[];
  asked: Record<string, string | number>;
  paths: SimulatedFlight[];
}

export interface PrepareCompensation {
  type: "prepare_compensation";
  serial: number;
}

export interface PrepareOrder {
  type: "prepare_order";
  serial: number;
}

export interface PrepareUpload {
  type: "prepare_upload";
  serial: number;
}

export interface PreviewMapEdit {
  type: "preview_map_edit";
  serial: number;
  action?: "add" | "no-fly" | "clear" | "remove";
  shape?: Shape | null;
  edit?: number | null;
}

export interface Problem {
  reason: string;
  remedy: string;
  waypoint: number | null;
}

export interface ProjectEntry {
  folder: string;
  name: string;
  current: boolean;
  trajectories: number;
  flights: number;
  problem: string;
  where: string;
}

export interface Projects {
  type: "projects";
  projects: ProjectEntry[];
}

export interface ProposedEquation {
  sentence: string;
  effect: string;
  facts: string;
}

export interface Question {
  serial: number;
}

export interface RandomYaw {
  type: "random_yaw";
  serial: number;
  revision: number;
  waypoints: number[];
}

export interface ReadPairs {
  type: "read_pairs";
  serial: number;
  flight: string;
  x: string;
  y: string;
  from_s: number;
  to_s: number;
}

export interface ReadScatter {
  type: "read_scatter";
  serial: number;
  channel: string;
  variable: string;
}

export interface ReadSpectrogram {
  type: "read_spectrogram";
  serial: number;
  flight: string;
  stream: string;
  from_s: number;
  to_s: number;
}

export interface ReadSpectrum {
  type: "read_spectrum";
  serial: number;
  flight: string;
  stream: string;
  from_s: number;
  to_s: number;
}

export interface ReadStreams {
  type: "read_streams";
  serial: number;
  flight: string;
  streams: string[];
  from_s: number;
  to_s: number;
  points: number;
}

export interface RecordedPath {
  source: string;
  positions: number;
  left_out: number;
  waypoints: number;
}

export interface Redo {
  type: "redo";
  serial: number;
}

export interface RenameFlight {
  type: "rename_flight";
  serial: number;
  flight: string;
  name: string;
}

export interface Reply {
  type: "reply";
  serial: number;
  error: string;
  nonce: string;
  here: Held | null;
  there: Held | null;
  name: string;
  flights: OpenedFlight[];
  aligned: Aligned[];
  parts: StreamPart[];
  spectrum: Spectrum | null;
  spectrogram: Spectrogram | null;
  pairs: Pairs | null;
  scatter: Scatter | null;
  incoming: Incoming | null;
  compensation: Compensation | null;
  plans: PlanSummary[];
  words: string;
  recorded_path: RecordedPath | null;
  vehicles: FoundVehicle[];
  invitation: Invitation | null;
}

export interface Restore {
  type: "restore";
  serial: number;
  file: string;
}

export interface RestoreFlight {
  type: "restore_flight";
  serial: number;
  kept: string;
}

export interface ReturnTo {
  type: "return_to";
  serial: number;
  version: number;
}

export interface Reverse {
  type: "reverse";
  serial: number;
  revision: number;
}

export interface Save {
  type: "save";
  serial: number;
  name: string;
  overwrite?: boolean;
}

export interface SavedTrajectory {
  name: string;
  duration_s: number;
  checked: boolean;
  saved_at: string;
}

export interface Scatter {
  channel: string;
  unit: string;
  variable: VariableName;
  share: number;
  x: number[];
  y: number[];
  flight: number[];
  time_s: number[];
  flights: string[];
  held_out: boolean[];
  bin_x: number[];
  bin_mean: number[];
  bin_band: number[];
  span_s: number;
}

export interface Section {
  low_m: [number, number];
  height_m: number;
  cell_m: number;
  rows: string[];
}

export interface Segment {
  start_s: number;
  end_s: number;
  start: number | null;
  end: number | null;
  binding: string;
  share: number;
  worst_s: number;
}

export interface Select {
  type: "select";
  serial: number;
  waypoints: number[];
}

export interface Selection {
  type: "selection";
  waypoints: number[];
}

export interface SendCompensation {
  type: "send_compensation";
  serial: number;
  nonce: string;
  accepted_mark?: string;
}

export interface Series {
  time_s: number[];
  x_m: number[];
  y_m: number[];
  z_m: number[];
  speed_m_s: number[];
  acceleration_m_s2: number[];
  clearance_m: number[];
  tilt_deg: number[];
  rotor_slowest_rad_s: number[];
  rotor_fastest_rad_s: number[];
  yaw_rate_deg_s: number[];
  thrust_n: number[];
  rotor_margin_percent: number[];
  q_world_body: number[];
  could_hide_mm: number[];
}

export interface SetGate {
  type: "gate";
  serial: number;
  revision: number;
  waypoint: number;
  width_m?: number | null;
  height_m?: number | null;
  heading_deg?: number | null;
  pitch_deg?: number | null;
  roll_deg?: number | null;
}

export interface SetGround {
  type: "ground";
  serial: number;
  revision: number;
  end: "take_off" | "landing";
  x_m?: number | null;
  y_m?: number | null;
  z_m?: number | null;
  climb_m_s?: number | null;
}

export interface SetNote {
  type: "set_note";
  serial: number;
  flight: string;
  note: string;
}

export interface SetRole {
  type: "set_role";
  serial: number;
  flight: string;
  role: "learn" | "hold_out" | "leave";
}

export interface SetTube {
  type: "tube";
  serial: number;
  revision: number;
  radius_m: number | null;
}

export interface Settings {
  speed_m_s: number;
  acceleration_m_s2: number;
  jerk_m_s3: number | null;
  margin_m: number;
  yaw: "along_path" | "smooth" | "steady" | "fixed" | "look_at" | "free";
  method: "fastest" | "corridor";
  heading_deg: number;
  look_at_m: [number, number, number] | null;
}

export interface Shape {
  form: "box" | "sphere" | "prism" | "stroke" | "other";
  centre_m: [number, number, number];
  size_m: [number, number, number];
  radius_m: number;
  corners_m: [number, number][];
  points_m: [number, number, number][];
}

export interface Shift {
  type: "shift";
  serial: number;
  revision: number;
  waypoints: number[];
  x_m?: number;
  y_m?: number;
  z_m?: number;
}

export interface Show {
  type: "show";
  serial: number;
  colour?: "clearance" | "could_hide" | "speed" | "thrust" | "tilt" | "rotor_margin";
  flights?: boolean;
}

export interface ShowFlights {
  type: "show_flights";
  serial: number;
  flights: string[];
  colour?: "" | "F_x" | "F_y" | "F_z" | "M_x" | "M_y" | "M_z";
  arrows?: boolean;
  predicted_s?: number | null;
  moved_s?: Record<string, number>;
}

export interface ShowMap {
  type: "show_map";
  serial: number;
  slice: Slice | null;
  layers: ("mesh" | "cameras" | "points" | "edits" | "axes" | "heights")[];
}

export interface ShowMoments {
  type: "show_moments";
  serial: number;
  stretches: Stretch[];
}

export interface Shown {
  type: "shown";
  colour: "clearance" | "could_hide" | "speed" | "thrust" | "tilt" | "rotor_margin";
  author: string;
  flights: boolean;
}

export interface SimulatedFlight {
  x_m: number[];
  y_m: number[];
  z_m: number[];
  clearance_m: number[];
  ends: number;
  is_worst: boolean;
}

export interface Slice {
  axis: "x" | "y" | "z" | "oblique";
  at_m: number;
  of: "distance" | "unknown" | "could_hide" | "surface_std";
  heading_deg: number;
  tilt_deg: number;
}

export interface Snap {
  type: "snap";
  serial: number;
  revision: number;
  waypoints: number[];
  to: "grid" | "height" | "clearance";
  by_m: number;
}

export interface Spectrogram {
  flight: string;
  key: string;
  time_s: number[];
  frequency_hz: number[];
  power_db: number[][];
}

export interface Spectrum {
  flight: string;
  key: string;
  curves: SpectrumCurve[];
}

export interface SpectrumCurve {
  label: string;
  kind: "measured" | "plan" | "model" | "residual";
  frequency_hz: number[];
  density: number[];
  share: number;
}

export interface Stair {
  model: string;
  errors_mm: number[];
}

export interface StartJob {
  type: "start_job";
  serial: number;
  kind: string;
  arguments: Record<string, string | number | boolean | string[]>;
}

export interface Stream {
  key: string;
  name: string;
  unit: string;
  group: "flight" | "force" | "column";
}

export interface StreamPart {
  flight: string;
  key: string;
  time_s: number[];
  curves: CurvePart[];
  band: number | null;
}

export interface Stretch {
  flight: string;
  from_s: number;
  to_s: number;
}

export interface TakeControl {
  type: "take_control";
  serial: number;
  force?: boolean;
}

export interface TakeLog {
  type: "take_log";
  serial: number;
  file: string;
  column_map?: string;
}

export interface TakePath {
  type: "take_path";
  serial: number;
  source: string;
  tolerance_m: number;
}

export interface ThinPath {
  type: "thin_path";
  serial: number;
  source: string;
  tolerance_m: number;
}

export interface Trial {
  flight: string;
  values: number[];
  sigmas: number[];
}

export interface Tried {
  effect: string;
  title: string;
  verdict: string;
  use: string;
  reasons: string[];
  quantities: string[];
  units: string[];
  as_it_was: number[];
  before: number[];
  after: number[];
  held_out: string[];
  changes: string[];
  vehicle_hash: string;
}

export interface Turn {
  type: "turn";
  serial: number;
  revision: number;
  waypoints: number[];
  yaw_deg: number | null;
}

export interface Undo {
  type: "undo";
  serial: number;
}

export interface Upload {
  type: "upload";
  serial: number;
  nonce: string;
}

export interface VariableName {
  name: string;
  unit: string;
  words: string;
}

export interface Vehicle {
  type: "vehicle";
  link: "none" | "fresh" | "stale" | "lost";
  name: string;
  age_s: number;
  mission: string;
  armed: boolean;
  holds: string;
  holds_crc32: string;
  battery_v: number | null;
  battery_left_s: number | null;
  x_m: number | null;
  y_m: number | null;
  z_m: number | null;
  error_m: number | null;
  room_m: number | null;
  speed_m_s: number | null;
  yaw_rad: number | null;
  along_s: number | null;
  duration_s: number | null;
  checks: ArmingCheck[];
  largest_error_m: number | null;
  if_link_lost: LostLinkAct[];
  reason: string;
  foreign: Foreign | null;
}

export interface VehicleCommand {
  serial: number;
}

export interface VehicleVersion {
  number: number;
  action: string;
  effect: string;
  when: string;
  current: boolean;
  undone: boolean;
  position_mm: number | null;
  verdict: string;
  changes: string[];
}

export interface ViewScales {
  type: "view_scales";
  heights_m: Record<string, number>;
}

export interface Waypoint {
  id: number;
  x_m: number;
  y_m: number;
  z_m: number;
  yaw_deg: number | null;
  stay_s: number;
  fly_by_m: number;
  leg_speed_m_s: number | null;
  leg_jerk_m_s3: number | null;
  velocity_m_s: [number, number, number] | null;
  gate: Gate | null;
}

export interface Welcome {
  type: "welcome";
  protocol: number;
  you: string;
  project: string;
  station: string;
}

export type ToPage = Comparison | Cursor | Diagnosis | Document | Draft | EffectFiles | Files | FlightMoment | Flights | FlightsShown | Identification | InvitationEnded | Jobs | MapPreview | MapSection | MapShown | Measured | Model | NextFlight | Notice | People | Plan | Preflight | Projects | Reply | Selection | Shown | Vehicle | ViewScales | Welcome;

export type FromPage = Abort | AddMapEdit | AgreeToEffectFile | AlignFlights | Ask | CancelJob | ChangeMapEdit | Choose | ClearGate | ClearGround | ComparePlans | Connect | Delete | Discard | DiscardFlight | DraftEffect | DrawPlainly | DropMapEdits | DropPath | DropTried | EndInvitation | FixFlight | Follow | ForeseeJob | ForgetJob | GiveUpControl | Insert | Invite | Keep | Kill | ListFlights | ListJobs | ListProjects | Look | LookAtFlight | LookAtVehicle | LookForVehicles | Loop | Measure | Move | NewProject | Open | OpenFlights | OpenProject | Order | Paint | Pass | PlanAgain | PrepareCompensation | PrepareOrder | PrepareUpload | PreviewMapEdit | RandomYaw | ReadPairs | ReadScatter | ReadSpectrogram | ReadSpectrum | ReadStreams | Redo | RenameFlight | Restore | RestoreFlight | ReturnTo | Reverse | Save | Select | SendCompensation | SetGate | SetGround | SetNote | SetRole | SetTube | Shift | Show | ShowFlights | ShowMap | ShowMoments | Snap | StartJob | TakeControl | TakeLog | TakePath | ThinPath | Turn | Undo | Upload;
