// Units for people. The set-up and the runs are in rad and rad/s; what is shown and typed is in the
// units that were chosen.

/** What is measured: the ball's angle and speed, the body's tilt and tilt rate. */
export type Quantity = "ball" | "tilt" | "ballSpeed" | "tiltRate";

/** Metres on the floor and degrees, or rad throughout, as in the files. */
export type UnitSystem = "metres" | "radians";

export interface Unit {
  name: string;
  /** This many rad, or rad/s, are one of it. */
  factor: number;
}

const DEGREE = Math.PI / 180;
const STORED = "units";

/** The unit of a quantity, of a robot with this ball radius, m. */
export function unitOf(quantity: Quantity, system: UnitSystem, ballRadius: number): Unit {
  const isRate = quantity === "ballSpeed" || quantity === "tiltRate";
  const per = isRate ? "/s" : "";
  if (system === "radians") return { name: `rad${per}`, factor: 1 };
  const ofBall = quantity === "ball" || quantity === "ballSpeed";
  return ofBall ? { name: `m${per}`, factor: 1 / ballRadius } : { name: `deg${per}`, factor: DEGREE };
}

/** The choice of the last visit; a browser may keep nothing. */
export function storedSystem(): UnitSystem {
  try {
    return localStorage.getItem(STORED) === "radians" ? "radians" : "metres";
  } catch {
    return "metres";
  }
}

export function storeSystem(system: UnitSystem): void {
  try {
    localStorage.setItem(STORED, system);
  } catch {
    // It holds until the page is left.
  }
}
