// What the strip charts show: one quantity per strip.

import { ROW } from "../layout";
import type { Range, Scenario } from "../scenario";
import { TERMS } from "../terms";
import type { Quantity } from "../units";

/** What a strip shows. */
export interface Strip {
  /** What it is, in a few words. */
  title: string;
  /** The same where lengths on the floor are shown. */
  inMetres?: string;
  /** One sentence more. */
  meaning: string;
  unit: string;
  /** Its unit is the one that was chosen. */
  quantity?: Quantity;
  /** Column of the sample, or a motor by its number. */
  column?: number;
  motors?: boolean;
  /** Component of the predicted state. */
  predicted?: number;
  bound?: (bounds: Scenario["bounds"]) => Range | undefined;
  /** Held from each sample to the next. */
  held?: boolean;
  logarithmic?: boolean;
  /** The smallest half-height of the scale, so that noise does not fill the strip. */
  least: number;
  fromZero?: boolean;
  reference?: boolean;
}

export const STRIPS: Strip[] = [
  {
    title: "phi: angle of the ball", inMetres: "r phi: position of the ball", meaning: TERMS.phi, unit: "", quantity: "ball",
    column: ROW.phi, predicted: 0, bound: (b) => b.phi_rad, least: 0.5, reference: true,
  },
  {
    title: "theta: tilt of the body", meaning: TERMS.theta, unit: "", quantity: "tilt",
    column: ROW.theta, predicted: 1, bound: (b) => b.theta_rad, least: 0.05,
  },
  {
    title: "phi_dot: speed of the ball", inMetres: "r phi_dot: speed of the ball", meaning: "How fast phi changes.", unit: "", quantity: "ballSpeed",
    column: ROW.phiDot, predicted: 2, bound: (b) => b.phi_dot_rad_s, least: 1,
  },
  {
    title: "theta_dot: tilt rate", meaning: "How fast theta changes.", unit: "", quantity: "tiltRate",
    column: ROW.thetaDot, predicted: 3, bound: (b) => b.theta_dot_rad_s, least: 0.2,
  },
  {
    title: "torque on the ball", meaning: TERMS.torque, unit: "N m",
    column: ROW.torque, bound: (b) => b.torque_nm, held: true, least: 0.05,
  },
  { title: "torques of motors 1, 2, 3", meaning: TERMS.motors, unit: "N m", motors: true, held: true, least: 0.05 },
  { title: "cost J of the plan", meaning: TERMS.cost, unit: "", column: ROW.cost, held: true, logarithmic: true, least: 1 },
  { title: "active bounds", meaning: TERMS.activeBound, unit: "", column: ROW.activeBounds, held: true, least: 2, fromZero: true },
  { title: "time per step", meaning: TERMS.step, unit: "\u00b5s", column: ROW.stepMicroseconds, held: true, least: 20, fromZero: true },
];
