// Fields that show and change values of the set-up, each by its path.

import { kindOf, valueAt, type Range, type Scenario } from "../scenario";
import { unitOf, type Quantity, type Unit, type UnitSystem } from "../units";
import { checkField, choiceField, numberField, rangeField, type FieldSpec, type Measured, type NumberSpec } from "./fields";

export interface FormNumber extends NumberSpec {
  /** The set-up's unit over the field's. */
  factor?: number;
  /** Shown where the set-up has no value. */
  absent?: number;
  /** A second path that gets the same value. */
  also?: string;
}

export class Form {
  private readonly shows: ((setup: Scenario) => void)[] = [];
  private readonly forgets: (() => void)[] = [];
  private readonly measures: ((unit: (quantity: Quantity) => Unit) => void)[] = [];

  /** `change` sets a value of the set-up; `undefined` leaves the key out. */
  constructor(readonly change: (path: string, value: unknown) => void) {}

  show(setup: Scenario): void {
    for (const show of this.shows) show(setup);
  }

  /** Calls back with every set-up that is shown. */
  watch(show: (setup: Scenario) => void): void {
    this.shows.push(show);
  }

  /** Another set-up was opened: tables of the one before are none of it. */
  opened(): void {
    for (const forget of this.forgets) forget();
  }

  /** What the key at a path held last, by its kind, since the set-up was opened: tables of a file come back
   *  when their kind is chosen again. `initial` is for kinds that it has not had. */
  remembered(path: string, initial: [kind: string, value: unknown][]): (kind: string) => unknown {
    let known = new Map(initial);
    this.forgets.push(() => (known = new Map(initial)));
    this.watch((setup) => {
      const value = valueAt(setup, path) as string | object | undefined;
      const kind = kindOf(value);
      if (kind !== undefined) known.set(kind, value);
    });
    return (kind) => known.get(kind);
  }

  /** From now on in these units, for a robot with this ball radius, m. */
  setUnits(system: UnitSystem, ballRadius: number): void {
    for (const measure of this.measures) measure((quantity) => unitOf(quantity, system, ballRadius));
  }

  /** Lets the field have the unit that was chosen for its quantity. */
  measured<F extends Measured<never>>(spec: FieldSpec, field: F): F {
    const { quantity } = spec;
    if (quantity) this.measures.push((unit) => field.measure(unit(quantity)));
    return field;
  }

  /** A number, in its own unit or in another one for people. */
  number(path: string, spec: FormNumber): HTMLElement {
    const factor = spec.factor ?? 1;
    const field = this.measured(spec, numberField(spec, (value) => {
      this.change(path, value * factor);
      if (spec.also !== undefined) this.change(spec.also, value * factor);
    }));
    this.watch((setup) => {
      const value = valueAt(setup, path);
      field.set((typeof value === "number" ? value : (spec.absent ?? NaN)) / factor);
    });
    return field.element;
  }

  /** A number that may be left to the controller: an empty field. */
  optional(path: string, spec: FormNumber): HTMLElement {
    return this.number(path, { ...spec, cleared: () => this.change(path, undefined) });
  }

  range(path: string, spec: FieldSpec): HTMLElement {
    const field = this.measured(spec, rangeField(spec, (value) => this.change(path, value)));
    this.watch((setup) => field.set((valueAt(setup, path) as Range | undefined) ?? [-Infinity, Infinity]));
    return field.element;
  }

  check(path: string, spec: FieldSpec & { absent: boolean }): HTMLElement {
    const field = checkField(spec, (on) => this.change(path, on));
    this.watch((setup) => field.set((valueAt(setup, path) as boolean | undefined) ?? spec.absent));
    return field.element;
  }

  /** `read` says which choice a set-up has, `write` what a choice puts at the path. */
  choice(
    path: string,
    spec: FieldSpec,
    choices: [value: string, text: string][],
    read: (value: unknown) => string,
    write: (value: string) => unknown,
  ): HTMLElement {
    const field = choiceField(spec, choices, (value) => this.change(path, write(value)));
    this.watch((setup) => field.set(read(valueAt(setup, path))));
    return field.element;
  }

  /** A table that may be absent, with a box that puts it in; its fields are seen while it is there. */
  table(path: string, spec: FieldSpec, initial: object, ...fields: HTMLElement[]): HTMLElement {
    const box = checkField(spec, (on) => this.change(path, on ? initial : undefined));
    const group = document.createElement("div");
    group.className = "table";
    group.append(...fields);
    const whole = document.createElement("div");
    whole.append(box.element, group);
    this.watch((setup) => {
      const present = valueAt(setup, path) !== undefined;
      box.set(present);
      group.hidden = !present;
    });
    return whole;
  }
}
