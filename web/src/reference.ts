// The way that a robot is to go, as a line on the floor.

import type { Simulation } from "./generated/ballbot_web.js";

/** Points of the line. */
const POINTS = 400;

/** Per plane: phi_ref at the same times. They are spread evenly over the pieces that it is made of, not
 *  over time: a path of seconds may stand in a run of an hour, or after its end. */
export function referencesOn(simulation: Pick<Simulation, "planes" | "knots" | "reference">): Float64Array[] {
  const planes = [...Array(simulation.planes()).keys()];
  const knots = Float64Array.from(new Set(planes.flatMap((plane) => [...simulation.knots(plane)]))).sort();
  const pieces = knots.length - 1;
  const times = Float64Array.from({ length: pieces > 0 ? POINTS : 1 }, (_, i) => {
    const place = (i * pieces) / (POINTS - 1);
    const from = knots[Math.floor(place)] ?? 0;
    const to = knots[Math.floor(place) + 1] ?? from;
    return from + (place % 1) * (to - from);
  });
  return planes.map((plane) => simulation.reference(plane, times));
}
