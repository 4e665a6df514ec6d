// The controllers that can stand side by side, each derived from the one set-up.

import type { Scenario } from "./scenario";

export interface RobotKind {
  name: string;
  label: string;
  /** Name of its colour in the style sheet. */
  colour: string;
  derive(setup: Scenario): Scenario;
}

function withController(setup: Scenario, change: Partial<Scenario["controller"]>): Scenario {
  const copy = structuredClone(setup);
  Object.assign(copy.controller, change);
  return copy;
}

export const ROBOTS: RobotKind[] = [
  {
    name: "lpv",
    label: "LPV MPC",
    colour: "--robot-lpv",
    derive: (setup) => withController(setup, { model: "lpv" }),
  },
  {
    name: "linear",
    label: "linear MPC",
    colour: "--robot-linear",
    derive: (setup) => withController(setup, { model: "linear" }),
  },
  {
    // Over one sample, with the cost-to-go of the LQR behind it and no state bound, the MPC's
    // optimum is u = -K x, clipped to the torque's bounds.
    name: "lqr",
    label: "LQR",
    colour: "--robot-lqr",
    derive: (setup) => {
      const made = withController(setup, { model: "linear", horizon: 1, terminal: "discrete_riccati" });
      // With a bounded rate it would be a law of five states, which knows another bound.
      delete made.controller["torque_rate"];
      const none: [number, number] = [-Infinity, Infinity];
      made.bounds = { ...made.bounds, phi_rad: none, theta_rad: none, phi_dot_rad_s: none, theta_dot_rad_s: none };
      return made;
    },
  },
];

export function robotsNamed(names: string[]): RobotKind[] {
  const chosen = ROBOTS.filter(({ name }) => names.includes(name));
  return chosen.length > 0 ? chosen : ROBOTS.slice(0, 1);
}

/** A robot's colour in the present theme. */
export function colourOf(robot: RobotKind | undefined): string {
  const name = (robot ?? ROBOTS[0])?.colour ?? "";
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
