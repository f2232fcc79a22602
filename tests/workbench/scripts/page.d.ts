// What a script of the workbench finds on its page: what `workbench.js` shares with all, and what NiceGUI brings.

/** Told when a key of the live table has another value, and at once for those that there are. Its end stops that. */
type Heard = (key: string, value: any) => void;
type End = () => void;

interface Detent {
  /** Set up every element with `data-part="NAME"`, as it comes; what `setup` gives back is called when it is gone. */
  part(name: string, setup: (element: any) => End | void): void;
  on(prefix: string, heard: Heard): End;
  /** Called after each change of the live table. */
  frame(drawn: () => void): End;
  get(key: string): any;
  keys(): Iterable<string>;
  /** Make a call to the process of the pages. Throws what it says is wrong. */
  call(name: string, ...args: any[]): Promise<any>;
  /** The same by hand: what is wrong is shown, and nothing is thrown. */
  action(name: string, ...args: any[]): Promise<any>;
  meant(key: string, now?: any): any;
  underWay(key: string): boolean;
  make<T>(key: string, value: any, going: () => Promise<T>): Promise<T>;
  turnTime(): Promise<any>;
  turning(): boolean;
  toast(text: string, kind?: "note" | "error"): void;
  theme(): "dark" | "light";
  onTheme(heard: () => void): End;
  remembered(name: string): any;
  remember(name: string, value: any): void;
  seconds(ns: number | null | undefined): string;
  grouped(number: number): string;
  forms: Record<string, (value: any) => string>;
}

interface Window {
  detent: Detent;
  Quasar?: { Dark: { set(dark: boolean): void } };
}

declare const detent: Detent;

declare module "nicegui-codemirror";
