// The set-up: every number of the scenario that a person may want to turn while it runs.

import { ROBOTS } from "../robots";
import { kindOf, valueAt, type Range, type Scenario, type Terminal } from "../scenario";
import { button, buttons, checkField, choiceField, note, numberField, rangeField, section, type Field, type NumberSpec } from "./fields";

export interface PanelActions {
  preset(name: string): void;
  /** A value of the set-up was changed; `undefined` leaves the key out. */
  change(path: string, value: unknown): void;
  robots(names: string[]): void;
  target(x: number, y: number): void;
  push(x: number, y: number): void;
  openFiles(): void;
  saveToml(): void;
  saveCsv(): void;
  copyLink(): void;
}

type Show = (setup: Scenario) => void;

const RAD_PER_DEG = Math.PI / 180;

/** The largest number of sub-steps the slider offers; the field takes any. */
const SUBSTEPS = 8;

function licences(): HTMLElement {
  const link = document.createElement("a");
  [link.href, link.textContent, link.className] = ["./licences.txt", "Licences", "note licences"];
  return link;
}

export class Panel {
  private readonly shows: Show[] = [];
  private readonly presetField: Field<string>;
  private readonly robotFields = new Map<string, Field<boolean>>();
  private chosen: string[] = [];
  private initialTerminal: Terminal = "discrete_riccati";
  private targetFields: [Field<number>, Field<number>];
  private pushBy = 3;
  private target = { x: 0, y: 0 };

  constructor(host: HTMLElement, presets: [name: string, title: string][], private readonly actions: PanelActions) {
    this.presetField = choiceField({ label: "Scenario" }, presets, (name) => actions.preset(name));
    this.targetFields = [
      numberField({ label: "Target X", unit: "m", min: -3, max: 3, step: 0.05 }, (x) => this.moveTarget(x, this.target.y)),
      numberField({ label: "Target Y", unit: "m", min: -3, max: 3, step: 0.05 }, (y) => this.moveTarget(this.target.x, y)),
    ];
    host.append(
      section("Scenario", true, this.presetField.element, this.files()),
      section("Robots side by side", true, ...this.robotChoices(), note("LQR: u = -Kx, clipped to the torque's bounds; it knows no other bound.")),
      section("Target and push", true, this.targetFields[0].element, this.targetFields[1].element, ...this.pushes()),
      section("Controller", true, ...this.controller()),
      section("Bounds", false, ...this.bounds()),
      section("World", false, ...this.world(), note("The controller knows nothing of these. With any of them set, a controller without a plan goes on with its best guess; in an ideal world it gives up.")),
      licences(),
    );
  }

  private moveTarget(x: number, y: number): void {
    this.actions.target(x, y);
  }

  private files(): HTMLElement {
    const { actions } = this;
    return buttons(
      button("Open\u2026", "Open a set-up (TOML) or recorded runs (trajectory.csv); or drop them on the page", () => actions.openFiles()),
      button("Save TOML", "The set-up as a file for `ballbot simulate`", () => actions.saveToml()),
      button("Save CSV", "The run so far", () => actions.saveCsv()),
      button("Copy link", "An address that holds the whole set-up", () => actions.copyLink()),
    );
  }

  private robotChoices(): HTMLElement[] {
    return ROBOTS.map(({ name, label, colour }) => {
      const field = checkField({ label }, (on) => {
        const names = new Set(this.chosen);
        if (on) names.add(name);
        else names.delete(name);
        this.actions.robots([...names]);
      });
      field.element.classList.add("swatch", colour.slice(2));
      this.robotFields.set(name, field);
      return field.element;
    });
  }

  private pushes(): HTMLElement[] {
    const strength = numberField({ label: "Push", unit: "rad/s", title: "Change of the tilt rate at once", min: 0.5, max: 40, step: 0.5 }, (value) => {
      this.pushBy = value;
    });
    strength.set(this.pushBy);
    const push = (text: string, title: string, x: number, y: number) =>
      button(text, title, () => this.actions.push(x * this.pushBy, y * this.pushBy));
    return [
      strength.element,
      buttons(push("\u2190", "Push towards -x", -1, 0), push("\u2192", "Push towards +x", 1, 0), push("\u2191", "Push towards +y", 0, 1), push("\u2193", "Push towards -y", 0, -1)),
    ];
  }

  /** A number of the set-up, in its own unit or in another one for people. */
  private number(path: string, spec: NumberSpec & { factor?: number; absent?: number; also?: string }): HTMLElement {
    const factor = spec.factor ?? 1;
    const field = numberField(spec, (value) => {
      this.actions.change(path, value * factor);
      if (spec.also !== undefined) this.actions.change(spec.also, value * factor);
    });
    this.shows.push((setup) => {
      const value = valueAt(setup, path);
      field.set((typeof value === "number" ? value : (spec.absent ?? 0)) / factor);
    });
    return field.element;
  }

  private controller(): HTMLElement[] {
    const names = ["phi", "theta", "phi_dot", "theta_dot"];
    const q = names.map((name, i) => this.number(`controller.q.${i}`, { label: `Q ${name}`, min: 0.01, max: 10000, logarithmic: true }));
    return [
      this.number("controller.horizon", { label: "Horizon N", unit: "samples", min: 1, max: 200, step: 1 }),
      this.number("controller.t_s", { label: "Sampling t_s", unit: "ms", factor: 1e-3, min: 1, max: 100, logarithmic: true }),
      ...q,
      this.number("controller.r", { label: "R", min: 1, max: 100000, logarithmic: true }),
      this.terminal(),
      this.predictor(),
    ];
  }

  private terminal(): HTMLElement {
    const field = choiceField(
      { label: "Terminal" },
      [["discrete_riccati", "cost of the LQR"], ["equality", "equality x_N = x_ref"], ["none", "none"], ["continuous_riccati", "continuous Riccati (paper)"], ["given", "as in the file"]],
      (kind) => {
        const continuous = kindOf(this.initialTerminal) === kind ? this.initialTerminal : { continuous_riccati: {} };
        const value = kind === "given" ? this.initialTerminal : kind === "continuous_riccati" ? continuous : kind;
        this.actions.change("controller.terminal", value);
      },
    );
    const known = ["discrete_riccati", "equality", "none", "continuous_riccati"];
    this.shows.push(({ controller: { terminal } }) => {
      const kind = kindOf(terminal) ?? "discrete_riccati";
      field.set(known.includes(kind) ? kind : "given");
    });
    return field.element;
  }

  private predictor(): HTMLElement {
    const substeps = numberField({ label: "Sub-steps", title: "Runge-Kutta steps per sample; empty: chosen from the fastest pole", min: 1, max: SUBSTEPS, step: 1, whenEmpty: 0 }, (value) =>
      this.actions.change("controller.predictor", value === 0 ? undefined : { rk4: { substeps: value } }),
    );
    this.shows.push((setup) => {
      const value = valueAt(setup, "controller.predictor.rk4.substeps");
      substeps.set(typeof value === "number" ? value : NaN);
    });
    return substeps.element;
  }

  private bounds(): HTMLElement[] {
    const row = (key: keyof Scenario["bounds"], label: string, unit: string) => {
      const field = rangeField({ label, unit }, (value) => this.actions.change(`bounds.${key}`, value));
      this.shows.push(({ bounds }) => field.set(bounds[key] as Range));
      return field.element;
    };
    return [
      row("phi_rad", "phi", "rad"),
      row("theta_rad", "theta", "rad"),
      row("phi_dot_rad_s", "phi_dot", "rad/s"),
      row("theta_dot_rad_s", "theta_dot", "rad/s"),
      row("torque_nm", "torque", "N m"),
    ];
  }

  private world(): HTMLElement[] {
    const factor = (key: string, label: string) =>
      this.number(`world.robot.${key}_factor`, { label, title: "The robot's value over the controller's", min: 0.5, max: 1.5, step: 0.01, absent: 1 });
    return [
      this.number("world.floor.slope_x_deg", { label: "Slope x", unit: "deg", min: -10, max: 10, step: 0.5 }),
      this.number("world.floor.slope_y_deg", { label: "Slope y", unit: "deg", min: -10, max: 10, step: 0.5 }),
      this.number("world.sensors.theta.noise_rad", { label: "Noise, angles", also: "world.sensors.phi.noise_rad", unit: "deg", factor: RAD_PER_DEG, min: 0, max: 2, step: 0.05 }),
      this.number("world.sensors.theta_dot.noise_rad_s", { label: "Noise, rates", also: "world.sensors.phi_dot.noise_rad_s", unit: "rad/s", min: 0, max: 0.5, step: 0.01 }),
      this.number("world.delay.transport_s", { label: "Delay", unit: "ms", factor: 1e-3, min: 0, max: 60, step: 1 }),
      factor("b1", "b1 factor"),
      factor("b2", "b2 factor"),
      factor("b3", "b3 factor"),
      factor("b4", "b4 factor"),
      factor("centre_of_mass", "l factor"),
      this.number("world.actuator.limit_nm", { label: "Motor limit", unit: "N m", whenEmpty: Infinity, absent: Infinity }),
      this.number("world.seed", { label: "Seed", title: "The same seed, the same noise" }),
    ];
  }

  /** Shows this set-up. */
  show(setup: Scenario, preset: string, robots: string[]): void {
    this.chosen = robots;
    this.presetField.set(preset);
    for (const [name, field] of this.robotFields) field.set(robots.includes(name));
    for (const show of this.shows) show(setup);
  }

  /** A new scenario: its terminal ingredient is what "as in the file" means. */
  remember(setup: Scenario): void {
    this.initialTerminal = setup.controller.terminal;
  }

  showTarget(x: number, y: number): void {
    this.target = { x, y };
    this.targetFields[0].set(x);
    this.targetFields[1].set(y);
  }
}
