// What the strip charts show: one quantity per strip.

import { ROW } from "../protocol";
import type { Range, Scenario } from "../scenario";

/** What a strip shows. */
export interface Strip {
  title: string;
  unit: string;
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
  { title: "phi", unit: "rad", column: ROW.phi, predicted: 0, bound: (b) => b.phi_rad, least: 0.5, reference: true },
  { title: "theta", unit: "rad", column: ROW.theta, predicted: 1, bound: (b) => b.theta_rad, least: 0.05 },
  { title: "phi_dot", unit: "rad/s", column: ROW.phiDot, predicted: 2, bound: (b) => b.phi_dot_rad_s, least: 1 },
  { title: "theta_dot", unit: "rad/s", column: ROW.thetaDot, predicted: 3, bound: (b) => b.theta_dot_rad_s, least: 0.2 },
  { title: "torque", unit: "N m", column: ROW.torque, bound: (b) => b.torque_nm, held: true, least: 0.05 },
  { title: "motor torques", unit: "N m", motors: true, held: true, least: 0.05 },
  { title: "cost J", unit: "", column: ROW.cost, held: true, logarithmic: true, least: 1 },
  { title: "active bounds", unit: "", column: ROW.activeBounds, held: true, least: 2, fromZero: true },
  { title: "time per step", unit: "\u00b5s", column: ROW.stepMicroseconds, held: true, least: 20, fromZero: true },
];
