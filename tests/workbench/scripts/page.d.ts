// What a script of the workbench finds on its page: what `workbench.js` shares with all, and what NiceGUI brings. What calls
// are answered with is in `calls.d.ts`.

/** Told when a key of the live table has another value, and at once for those that there are. Its end stops that. */
type Heard = (key: string, value: any) => void;
type End = () => void;
type Setup = (element: Part) => End | void;

/** An element of a page. Its script is written together with the page: what it looks for in its part is there. */
type Part = {
  querySelector(selector: string): Part;
  querySelectorAll(selector: string): NodeListOf<Part>;
  closest(selector: string): Part;
  parentElement: Part;
  firstElementChild: Part;
  lastElementChild: Part;
  dataset: Record<string, any>;
  /** What is not of every element: `value`, `disabled`, `elements`, `showModal`... */
  [name: string]: any;
} & HTMLElement;

/** What the live table has of the cell itself (`detent.workbench.board`); of its parts, keys like `u.NAME.state`. */
interface Live {
  /** Cell time in ns: the present of what is shown, and from where to where it may be gone to. */
  now: number;
  begin: number;
  end: number;
  /** Cell time by real time; null: as fast as it goes. */
  pace: number | null;
  held: boolean;
  /** Why it stands. */
  why: string;
  past: boolean;
  faster: number;
  late: number;
  dropped: number;
  breakerrors: boolean;
  /** The numbers of what stands broken, with words. */
  faults: [number, string][];
}

interface Detent {
  /** Set up every element with `data-part="NAME"`, as it comes; what `setup` gives back is called when it is gone. */
  part(name: string, setup: Setup): void;
  on(prefix: string, heard: Heard): End;
  /** Called after each change of the live table. */
  frame(drawn: () => void): End;
  get<Key extends keyof Live>(key: Key): Live[Key];
  get(key: string): any;
  keys(): Iterable<string>;
  /** Make a call to the process of the pages. Throws what it says is wrong. */
  call<Name extends keyof Calls>(name: Name, ...args: Parameters<Calls[Name]>): Promise<ReturnType<Calls[Name]>>;
  /** The same for several calls that one hand began: what moves is refused behind a stop that came after that. */
  asking(): <Name extends keyof Calls>(name: Name, ...args: Parameters<Calls[Name]>) => Promise<ReturnType<Calls[Name]>>;
  /** The same by hand: what is wrong is shown, and nothing is thrown. */
  action<Name extends keyof Calls>(name: Name, ...args: Parameters<Calls[Name]>): Promise<ReturnType<Calls[Name]> | null>;
  meant(key: string, now?: any): any;
  underWay(key: string): boolean;
  make<T>(key: string, value: any, going: () => Promise<T>): Promise<T>;
  turnTime(): Promise<any>;
  turning(): boolean;
  toast(text: string, kind?: "note" | "error"): void;
  /** Show what was thrown, as an error. */
  failed(error: unknown): void;
  theme(): "dark" | "light";
  onTheme(heard: (theme: "dark" | "light") => void): End;
  remembered(name: string): any;
  remember(name: string, value: any): void;
  seconds(ns: number | null | undefined): string;
  grouped(number: number): string;
  forms: Record<string, (value: any) => string>;
}

// -- what the page Scope is told (detent/workbench/scope_feed.py) --

type Point = [number, number];
type Colour = (name: string) => string;

/** What is seen of the time of a cell, in ns. */
interface View {
  begin: number;
  end: number;
}

/** A trace of the catalogue. */
interface Trace {
  id: string;
  unit: string;
  name: string;
  title: string;
  lane: string;
  shape: "line" | "step";
  level: boolean;
  units: string;
}

/** Traces above each other, `top` and `height` in px, `low` and `high` the ends of what they show. */
interface Lane {
  name: string;
  level: boolean;
  traces: (Trace & { index: number })[];
  top: number;
  height: number;
  low: number;
  high: number;
}

/** The columns of a trace: the least and the greatest value of each, more than `base`. */
interface Columns {
  id: string;
  base: number;
  low: Float32Array;
  high: Float32Array;
  values: [any, any];
}

interface Frame {
  begin: number;
  width: number;
  first: number;
  now: number;
  from: number;
  to: number;
  trigger: number | null;
  marks?: { at: number }[];
  traces: Columns[];
}

interface Window {
  detent: Detent;
  Quasar?: { Dark: { set(dark: boolean): void } };
}

declare const detent: Detent;

declare module "nicegui-codemirror";
