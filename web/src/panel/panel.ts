// The set-up: every number of the scenario that a person may want to turn while it runs.

import { CAPACITY } from "../history";
import { ROBOTS } from "../robots";
import type { Scenario } from "../scenario";
import { TERMS } from "../terms";
import type { UnitSystem } from "../units";
import { boundFields, controllerFields, feedbackFields } from "./controller";
import { button, buttons, checkField, choiceField, note, numberField, section, type Field, type NumberSpec } from "./fields";
import { Form } from "./form";
import { worldFields } from "./world";

export interface PanelActions {
  preset(name: string): void;
  /** A value of the set-up was changed; `undefined` leaves the key out. */
  change(path: string, value: unknown): void;
  robots(names: string[]): void;
  units(system: UnitSystem): void;
  /** A coordinate of the target was typed, rad of the ball. */
  target(typed: { x?: number; y?: number }): void;
  push(x: number, y: number): void;
  openFiles(): void;
  saveToml(): void;
  saveCsv(): void;
  copyLink(): void;
}

function licences(): HTMLElement {
  const link = document.createElement("a");
  [link.href, link.textContent, link.className] = ["./licences.txt", "Licences", "note licences"];
  return link;
}

export class Panel {
  private readonly form: Form;
  private readonly presetField: Field<string>;
  private readonly robotFields = new Map<string, Field<boolean>>();
  private chosen: string[] = [];
  private targetFields: [Field<number>, Field<number>];
  private readonly unitField: Field<string>;
  private pushBy = Math.PI;

  constructor(host: HTMLElement, presets: [name: string, title: string][], private readonly actions: PanelActions) {
    this.form = new Form((path, value) => actions.change(path, value));
    this.presetField = choiceField({ label: "Scenario" }, presets, (name) => actions.preset(name));
    this.unitField = choiceField(
      { label: "Units", title: "Of fields and plots. Files hold rad; the weights Q and R are for rad, rad/s and N m" },
      [["metres", "m and degrees"], ["radians", "rad"]], (system) => actions.units(system as UnitSystem));
    const target = (label: string, order: (phi: number) => void) => {
      const spec: NumberSpec = { label, quantity: "ball", min: -25, max: 25, decimals: 4 };
      return this.form.measured(spec, numberField(spec, order));
    };
    this.targetFields = [target("Target X", (x) => actions.target({ x })), target("Target Y", (y) => actions.target({ y }))];
    host.append(
      section("Scenario", true, this.presetField.element, this.unitField.element, this.files()),
      section("Robots side by side", true, ...this.robotChoices(), note(`LPV MPC. ${TERMS.lpv}`), note(`Linear MPC. ${TERMS.linear}`), note(`LQR. ${TERMS.lqr}`)),
      section("Target and push", true, this.targetFields[0].element, this.targetFields[1].element, ...this.pushes()),
      section("Controller", true, ...controllerFields(this.form)),
      section("Bounds", false, ...boundFields(this.form)),
      section("On a real robot", false, ...feedbackFields(this.form), note("The feedback pipeline around the controller. Empty fields are the controller's defaults.")),
      section("World", false, ...worldFields(this.form), note("The controller knows nothing of these. With any of them set, a controller without a plan goes on with its best guess; in an ideal world it gives up.")),
      licences(),
    );
  }

  private files(): HTMLElement {
    const { actions } = this;
    return buttons(
      button("Open\u2026", "Open a set-up (TOML) or recorded runs (trajectory.csv); or drop them on the page", () => actions.openFiles()),
      button("Save TOML", "The set-up as a file for `ballbot simulate`", () => actions.saveToml()),
      button("Save CSV", `The run so far: the last ${CAPACITY} samples`, () => actions.saveCsv()),
      button("Copy link", "An address that holds the whole set-up", () => actions.copyLink()),
    );
  }

  private robotChoices(): HTMLElement[] {
    return ROBOTS.map(({ name, label, colour }) => {
      const field = checkField({ label }, (on) => {
        const names = new Set(this.chosen);
        if (on) names.add(name);
        else names.delete(name);
        // Until it is shown what holds: the next choice may come before.
        this.chosen = [...names];
        this.actions.robots(this.chosen);
      });
      field.element.classList.add("swatch", colour.slice(2));
      this.robotFields.set(name, field);
      return field.element;
    });
  }

  private pushes(): HTMLElement[] {
    const spec: NumberSpec = { label: "Push", quantity: "tiltRate", title: "Change of the tilt rate at once", min: 0, max: 40 };
    const strength = this.form.measured(spec, numberField(spec, (value) => {
      if (value > 0) this.pushBy = value;
      strength.set(this.pushBy);
    }));
    strength.set(this.pushBy);
    const push = (text: string, title: string, x: number, y: number) =>
      button(text, title, () => this.actions.push(x * this.pushBy, y * this.pushBy));
    return [
      strength.element,
      buttons(push("\u2190", "Push towards -x", -1, 0), push("\u2192", "Push towards +x", 1, 0), push("\u2191", "Push towards +y", 0, 1), push("\u2193", "Push towards -y", 0, -1)),
    ];
  }

  /** Another set-up was opened. */
  opened(): void {
    this.form.opened();
  }

  /** Shows this set-up. */
  show(setup: Scenario, preset: string, robots: string[]): void {
    this.chosen = robots;
    this.presetField.set(preset);
    for (const [name, field] of this.robotFields) field.set(robots.includes(name));
    this.form.show(setup);
  }

  /** In these units, for a robot with this ball radius, m. */
  setUnits(system: UnitSystem, ballRadius: number): void {
    this.unitField.set(system);
    this.form.setUnits(system, ballRadius);
  }

  /** Where the first robot is to go, rad of the ball. */
  showTarget(x: number, y: number): void {
    this.targetFields[0].set(x);
    this.targetFields[1].set(y);
  }
}
