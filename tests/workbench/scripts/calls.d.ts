// What windows may call, and what they are answered with. Made by tests/workbench/page_types.py: do not edit.

/** A row of a command table. */
interface Command {
  command: string;
  argument: string;
  what: string;
  section: string;
}

/** A text that was not saved yet, and the file that it is for. */
interface DraftText {
  text: string;
  file: string;
}

/** What units of a new cell can have; `supplies` and `direct` in V by motor, `axes` by model. */
interface Fittings {
  motors: string[];
  supplies: Record<string, number>;
  direct: Record<string, number>;
  uncontrolled: string[];
  axes: Record<string, string[]>;
  programs: string[];
}

/** Which axis: of a unit of the cell, or (`real`) the unit that is connected under this name. */
interface Place {
  unit: string;
  axis?: string;
  real?: boolean;
  options?: Record<string, string>;
}

/** An axis: its law and settings, what is in force, the motors to choose from and the one that is fitted. */
interface AxisFacts {
  unit: string;
  axis: string;
  real: boolean;
  options: Record<string, string>;
  model: string;
  law: string;
  units: string;
  most: number;
  steps: number;
  settings: SettingFacts[];
  values: Record<string, number>;
  steppings: string[];
  per_step: Record<string, number>;
  stepping: string;
  drives: string[];
  motors: MotorFacts[];
  fitted: FittedMotor | null;
}

/** A setting of a law, with its range and what it begins with. */
interface SettingFacts {
  name: string;
  title: string;
  unit: string;
  low: number;
  high: number;
  value: number;
  scale: number;
}

/** The form for a motor by name: V, A, kg cm2, Nm. */
interface MotorFacts {
  name: string;
  title: string;
  supply: number;
  current: number;
  inertia: number;
  torque: number;
  damping: number;
  steps: number;
  curve: boolean;
  wiring: string;
  wirings: string[];
}

/** The form for the motor that the cell file has on an axis, by its `name` there; `travel` in mm a turn. */
interface FittedMotor {
  name: string;
  motor: string;
  stepping: string;
  supply: number;
  current: number;
  inertia: number;
  friction: number;
  damping: number;
  travel: number | null;
  steps: number;
  wirings: string[];
}

/** An axis, and the move that it shall make. */
interface Axis {
  unit: string;
  axis?: string;
  real?: boolean;
  options?: Record<string, string>;
  values?: Record<string, number>;
  steps?: number;
}

/** A motor with its drive and load, as a person writes them: V, A, kg cm2, Nm. */
interface Form {
  motor: string;
  stepping: string;
  supply: number;
  current: number;
  inertia: number;
  friction: number;
  damping?: number | null;
  drive?: string;
  wiring?: string;
  fit?: boolean;
  own?: OwnMotor | null;
  moved?: Moved;
}

/** A motor of one's own: its TOML, and the CSV of its torque curve, measured with the drive of the form. */
interface OwnMotor {
  name: string;
  text: string;
  curve?: string;
  curve_name?: string;
}

/** What moves along a line: by mm a turn of a screw, or mm of radius of a pulley or pinion; kg, N, degrees. */
interface Moved {
  by?: "" | "screw" | "belt" | "rack";
  size?: number;
  gear?: number;
  mass?: number;
  slope?: number;
  force?: number;
  drag?: number;
}

/** Torque (Nm) over speed (units/s): what there is, what the move asks; the verdict, if it could be simulated. */
interface JudgedMove {
  curve: [number, number][];
  asked: [number, number][];
  travel: number | null;
  turn: number;
  verdict: MoveVerdict | null;
  words: string;
}

/** What a motor makes of a move: lost it, or with what margin; how many variants of how many lost it. */
interface MoveVerdict {
  lost: boolean;
  margin: number;
  angle: number;
  error: number;
  often: number;
  of: number;
}

/** A move drawn: at `times` in s the speed and the position; accelerations are (at, value); `duration` in ns. */
interface DrawnMove {
  values: Record<string, number>;
  steps: number;
  times: number[];
  speeds: number[];
  positions: number[];
  accelerations: [number, number][];
  duration: number;
  peak: number;
  mean: number;
  up: number;
  down: number;
  reached: boolean;
  remark: string;
  settings: string[];
  go: string;
}

/** What was chosen. */
interface NewCell {
  title?: string;
  units: NewUnit[];
  wires?: NewWire[];
  switches?: NewSwitch[];
  motors?: NewMotor[];
}

/** A unit: its name and model, straps that are not as the model has them, a program in a file beside the cell. */
interface NewUnit {
  name: string;
  model: string;
  straps?: Record<string, "low" | "high">;
  program?: string;
}

/** A wire from an output to an input, each UNIT.PIN. */
interface NewWire {
  source: string;
  target: string;
}

/** A switch on the panel, the input that it drives, and its level when the cell starts. */
interface NewSwitch {
  name: string;
  drives: string;
  level?: number;
}

/** A motor on the axis of a unit (`axis` "" where it has one): its name in the list, its supply in V, its lead. */
interface NewMotor {
  unit: string;
  axis?: string;
  motor: string;
  supply?: number;
  lead?: number | null;
}

/** What can be opened: pairs of a name and a title; `open` is what is shown now, `folder` where `cells` are. */
interface Places {
  open: string;
  models: [string, string][];
  examples: [string, string][];
  folder: string;
  cells: [string, string][];
}

/** What the editor must know of a unit; `source` is what it begins with where there is no draft. */
interface ProgramFacts {
  unit: string;
  model: string;
  title: string;
  language: boolean;
  comment: string;
  capacity: number;
  nonvolatile: boolean;
  words: Spelling[];
  file: string;
  source: string;
  line: string | null;
}

/** A command as it is spelt. `whole`: no letter may follow. */
interface Spelling {
  spelling: string;
  whole: boolean;
  rows: CommandRow[];
}

/** What the command table says of a spelling. */
interface CommandRow {
  form: string;
  takes: string;
  bytes: number;
  when: string;
  what: string;
  section: string;
  stored: boolean;
}

/** Errors (line, column, length, words), places (line, address, bytes) and labels of a text. */
interface CheckedProgram {
  errors: [number, number, number, string][];
  places: [number, number, number][];
  labels: Record<string, number>;
  used: number;
  capacity: number;
  loaded: boolean;
}

/** The lines that differ from program memory, and words for it. */
interface ComparedProgram {
  lines: number[];
  words: string;
  same: boolean;
}

/** Rows of a line: the numbers of the first and the next one; `cut` counts how often its past was taken back. */
interface LineTalk {
  first: number;
  next: number;
  cut: number;
  rows: LineRow[];
}

/** A row of a line of the cell; not `whole`: more may be added to it. */
interface LineRow {
  number: number;
  begin: number;
  sender: string;
  note: string;
  wrong: boolean;
  parts: [string, string, string, string][];
  whole: boolean;
}

/** What is to be fast: 200,1000x3; how many fresh variants prove it; the map, too; all corners must make it. */
interface Asked {
  moves: string;
  variants?: number;
  corners?: boolean;
  map?: boolean;
  seed?: number;
  vary?: string;
}

/** The settings at a place of the map: what would be sent, and how long the moves take (s). */
interface PickedSettings {
  settings: Record<string, number>;
  options: Record<string, string>;
  part: [number, number];
  commands: string[];
  go: string[];
  times: number[];
  time: number | null;
  settings_words: string;
  option_lines: string[];
  resets: string[];
}

/** What came of a line that was typed; `ms` until the answer was whole. */
interface LineSaid {
  unit: string;
  answers: string[];
  meaning: string;
  refused: boolean;
  meanings: string[];
  ms: number | null;
}

/** What restoring changes; `seen` goes with `unit_restore`. */
interface BackupDifferences {
  lines: string[];
  seen: string;
}

/** Ports with what is at them; units of the cell: name, model, address, options. */
interface UnitPlaces {
  ports: [string, string][];
  cell: [string, string, string, string][];
}

/** Rows of what was said with a real unit. */
interface UnitTalk {
  first: number;
  next: number;
  rows: UnitRow[];
}

/** A row of a real unit; a `question` was asked by the page itself. */
interface UnitRow {
  number: number;
  begin: number;
  sender: string;
  note: string;
  wrong: boolean;
  parts: [string, string, string, string][];
  question: boolean;
}

/** The file that was `saved`; or what is asked before it is, and then it is not. */
interface Written {
  saved?: string;
  asks?: string;
}

interface Calls {
  break_on_errors: (on: boolean) => null;
  breaks: (where: string, kind: string, given?: Record<string, string | number> | null) => number;
  command_reference: (model: string) => Command[];
  compare_branch: (number: number) => string[];
  draft: (name: string) => DraftText | null;
  end_silent: () => null;
  faster: () => null;
  files: (suffixes?: string[]) => string[];
  fittings: () => Fittings;
  forget_draft: (name: string) => null;
  go: () => null;
  hold: () => null;
  jacks: () => Record<string, Record<string, string[]>>;
  keep_draft: (name: string, text: string, file?: string) => null;
  mend: (number?: number | null) => null;
  motion_about: (place: Place) => AxisFacts;
  motion_motor: (wanted: Axis, form: Form) => JudgedMove;
  motion_move: (wanted: Axis) => DrawnMove;
  motion_own: (files: OwnMotor) => MotorFacts;
  new_cell: (cell: NewCell, name?: string) => string;
  open_place: (place: string) => string;
  pace: (times: number | null) => null;
  place_switch: (name: string, low: number | null, high: number | null) => null;
  places: () => Places;
  power: (unit: string, on: boolean) => null;
  program_about: (unit: string) => ProgramFacts;
  program_breakpoint: (unit: string, address: number, on: boolean) => null;
  program_breaks: (unit: string, addresses: number[]) => null;
  program_check: (unit: string, text: string) => CheckedProgram;
  program_compare: (unit: string, text: string, kept: boolean) => ComparedProgram;
  program_fetch: (unit: string, kept: boolean) => string;
  program_load: (unit: string, text: string, start: boolean) => string;
  program_run_to: (unit: string, address: number) => null;
  program_save: (unit: string) => string;
  read_file: (name: string) => string;
  recover: () => null;
  repeat_command: (line: string, unit: string, text: string, every: number) => null;
  restart: () => null;
  revive: () => null;
  rewind: (at: number) => null;
  run_script: (line: string, unit: string, text: string, comment?: string) => null;
  save_cell: (name: string, cell: NewCell, over?: boolean) => string;
  send: (line: string, data: string) => null;
  set_pin: (unit: string, pin: string, level: number | null) => null;
  set_strap: (unit: string, pin: string, level: number) => null;
  set_switch: (name: string, level: number) => null;
  slower: () => null;
  start: (unit: string) => null;
  step_back: (unit?: string | null) => null;
  step_event: () => null;
  step_instruction: (unit: string) => null;
  stop_all: () => string[];
  stop_motors: () => null;
  stop_script: (line: string) => null;
  take_branch: (number: number) => null;
  terminal: (line: string, since?: number) => LineTalk;
  tuning_begin: (wanted: Axis, form: Form, asked: Asked) => null;
  tuning_pick: (x: number, y: number) => PickedSettings;
  tuning_stop: () => null;
  type: (unit: string, text: string) => null;
  unit_again: (name: string) => null;
  unit_asking: (name: string, paused: boolean, rate?: number) => null;
  unit_backup: (name: string, file: string, over?: boolean) => string;
  unit_both: (names: string[], line: string) => LineSaid[];
  unit_compare: (name: string, source: string) => string[];
  unit_connect: (model: string, address: string, options?: string, name?: string) => string;
  unit_differs: (name: string, file: string) => BackupDifferences;
  unit_held: (name: string) => null;
  unit_hold: (name: string, rate: number) => string[];
  unit_leave: (name: string) => null;
  unit_lines: (name: string, lines: string[]) => LineSaid[];
  unit_move: (name: string, what: "jog" | "go" | "zero" | "home", value?: number) => string[];
  unit_places: () => UnitPlaces;
  unit_restore: (name: string, file: string, seen: string) => string[];
  unit_say: (name: string, line: string) => LineSaid;
  unit_source: (name: string) => string;
  unit_stop: (name: string) => string;
  unit_store: (name: string, source: string, save?: boolean) => string;
  unit_talk: (name: string, since?: number) => UnitTalk;
  withdraw: (number?: number | null) => null;
  write_file: (name: string, text: string, known?: string | null, over?: boolean) => Written;
}
