// The elements that the panel is made of. Every one is a native control with a label.

import { niceStep } from "../plots/range";
import type { Quantity, Unit } from "../units";

export interface FieldSpec {
  label: string;
  unit?: string;
  /** In place of `unit`: the field shows and takes the unit that was chosen for this; its values, limits
   *  of its slider included, are in rad or rad/s. */
  quantity?: Quantity;
  title?: string;
}

let count = 0;

function element<K extends keyof HTMLElementTagNameMap>(
  name: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function row(spec: FieldSpec, ...controls: HTMLElement[]): HTMLElement {
  const id = `field-${count++}`;
  const label = element("label", { textContent: spec.label, htmlFor: id });
  if (controls[0]) controls[0].id = id;
  for (const control of controls) {
    const part = control.getAttribute("aria-label");
    if (part !== null) control.setAttribute("aria-label", `${spec.label}, ${part}`);
  }
  const line = element("div", { className: "field" }, label, ...controls);
  if (spec.unit || spec.quantity) line.append(element("span", { className: "unit", textContent: spec.unit ?? "" }));
  if (spec.title) line.title = spec.title;
  return line;
}

/** Text of a number field, whole numbers with all their digits; an infinite bound is an empty field. */
function shown(value: number): string {
  if (Number.isSafeInteger(value)) return String(value);
  return Number.isFinite(value) ? String(Number(value.toPrecision(5))) : "";
}

/** What was typed; an empty field is `whenEmpty`, and what cannot be read as a number is NaN, to be refused with a reason. */
function typed(input: HTMLInputElement, whenEmpty: number): number {
  if (input.validity.badInput) return NaN;
  return input.value.trim() === "" ? whenEmpty : Number(input.value);
}

/** Lets a number field show a value, unless somebody is in the middle of typing into it. A field that
 *  was entered stays selected: what is typed next takes the place of the number, whichever it is. */
function displayOf(input: HTMLInputElement): (text: string) => void {
  let typing = false;
  input.addEventListener("input", () => (typing = true));
  for (const done of ["change", "blur"]) input.addEventListener(done, () => (typing = false));
  return (text) => {
    if (typing || input.value === text) return;
    input.value = text;
    if (document.activeElement === input) input.select();
  };
}

export interface NumberSpec extends FieldSpec {
  /** With both, a slider stands beside the number. */
  min?: number;
  max?: number;
  step?: number;
  /** No more digits after the point are shown. */
  decimals?: number;
  /** The slider moves in decades. */
  logarithmic?: boolean;
  /** What an empty field means; without it an empty field is not accepted. */
  whenEmpty?: number;
  /** What to do when the field was emptied, which then leaves the choice to the controller. */
  cleared?: () => void;
}

export interface Field<T> {
  element: HTMLElement;
  set(value: T): void;
}

/** A field whose unit may be another one from now on. */
export interface Measured<T> extends Field<T> {
  measure(unit: Unit): void;
}

function showUnit(line: HTMLElement, { name }: Unit): void {
  const shown = line.querySelector(".unit");
  if (shown) shown.textContent = name;
}

export function numberField(spec: NumberSpec, changed: (value: number) => void): Measured<number> {
  const input = element("input", { type: "number", inputMode: "decimal", step: "any" });
  const slides = spec.min !== undefined && spec.max !== undefined;
  const slider = element("input", { type: "range", step: String(spec.step ?? "any") });
  slider.setAttribute("aria-label", "slider");
  const display = displayOf(input);
  let factor = 1;
  const toSlider = (value: number) => (spec.logarithmic ? Math.log10(Math.max(value, 1e-9)) : value);
  const setLimits = () => {
    const [min, max] = [(spec.min ?? 0) / factor, (spec.max ?? 1) / factor];
    slider.min = String(toSlider(min));
    slider.max = String(toSlider(max));
    if (spec.logarithmic) slider.step = "0.05";
    else if (spec.quantity) slider.step = String(niceStep((max - min) / 100));
  };
  if (slides) setLimits();
  if (spec.whenEmpty !== undefined) input.placeholder = "none";
  if (spec.cleared) input.placeholder = "default";
  input.addEventListener("change", () => {
    if (input.value.trim() === "" && !input.validity.badInput && spec.cleared) {
      spec.cleared();
      return;
    }
    const value = typed(input, spec.whenEmpty ?? NaN);
    if (!Number.isNaN(value)) slider.value = String(toSlider(value));
    changed(value * factor);
  });
  // While it is held it shows where it is, then what holds.
  let [now, held, answered] = [NaN, false, true];
  slider.addEventListener("input", () => {
    [held, answered] = [true, false];
    const at = Number(slider.value);
    const value = spec.logarithmic ? Number((10 ** at).toPrecision(2)) : at;
    input.value = shown(value);
    changed(value * factor);
  });
  slider.addEventListener("change", () => {
    held = false;
    if (answered) slider.value = String(toSlider(now / factor));
  });
  const line = slides ? row(spec, input, slider) : row(spec, input);
  const set = (value: number) => {
    [now, answered] = [value, true];
    const inUnit = value / factor;
    display(shown(spec.decimals === undefined ? inUnit : Number(inUnit.toFixed(spec.decimals))));
    if (!held) slider.value = String(toSlider(inUnit));
  };
  return {
    element: line,
    set,
    measure(unit) {
      ({ factor } = unit);
      showUnit(line, unit);
      if (slides) setLimits();
      set(now);
    },
  };
}

/** [lower, upper]; an empty field is no bound. */
export function rangeField(spec: FieldSpec, changed: (value: [number, number]) => void): Measured<[number, number]> {
  const make = (name: string) => {
    const input = element("input", { type: "number", inputMode: "decimal", step: "any", placeholder: "none" });
    input.setAttribute("aria-label", name);
    return input;
  };
  const [lower, upper] = [make("lower bound"), make("upper bound")];
  const display = { lower: displayOf(lower), upper: displayOf(upper) };
  // Only the side that was typed: the other one may have more digits than are shown. The second may
  // be typed before it is shown what came of the first.
  let now: [number, number] = [-Infinity, Infinity];
  let factor = 1;
  lower.addEventListener("change", () => changed(now = [typed(lower, -Infinity) * factor, now[1]]));
  upper.addEventListener("change", () => changed(now = [now[0], typed(upper, Infinity) * factor]));
  const line = row(spec, lower, upper);
  const set = ([low, high]: [number, number]) => {
    now = [low, high];
    display.lower(shown(low / factor));
    display.upper(shown(high / factor));
  };
  return {
    element: line,
    set,
    measure(unit) {
      ({ factor } = unit);
      showUnit(line, unit);
      set(now);
    },
  };
}

export function choiceField(spec: FieldSpec, choices: [value: string, text: string][], changed: (value: string) => void): Field<string> {
  const select = element("select", {}, ...choices.map(([value, text]) => element("option", { value, textContent: text })));
  select.addEventListener("change", () => changed(select.value));
  return { element: row(spec, select), set: (value) => void (select.value = value) };
}

export function checkField(spec: FieldSpec, changed: (value: boolean) => void): Field<boolean> {
  const input = element("input", { type: "checkbox" });
  input.addEventListener("change", () => changed(input.checked));
  const box = row(spec, input);
  box.classList.add("check");
  return { element: box, set: (value) => void (input.checked = value) };
}

export function button(text: string, title: string, clicked: () => void): HTMLButtonElement {
  const made = element("button", { textContent: text, title, type: "button" });
  made.addEventListener("click", clicked);
  return made;
}

export function buttons(...made: HTMLButtonElement[]): HTMLElement {
  return element("div", { className: "buttons" }, ...made);
}

export function note(text: string): HTMLElement {
  return element("p", { className: "note", textContent: text });
}

export function section(title: string, open: boolean, ...children: HTMLElement[]): HTMLElement {
  const details = element("details", { open }, element("summary", { textContent: title }), ...children);
  return details;
}
