// What the words on the page mean: one sentence each.

export const TERMS = {
  phi: "Angle through which the ball has rolled: times the ball radius r, it is the ball's position on the floor.",
  theta: "Tilt of the body from upright; the body leans towards +x where theta is negative.",
  plane: "The robot is controlled in two vertical planes, x and y; each has its own phi, theta and torque.",
  torque: "Torque of the drive on the ball in this plane; positive, it rolls the ball towards +x (or +y).",
  motors: "What the three motors do together for the torques of both planes.",
  mpc: "Model predictive control: at every sample it plans the next N samples at the least cost within the bounds, and applies the first torque of the plan.",
  lpv: "Its model is linear parameter-varying; the matrices follow tilt and speed along the plan, so that it also holds far from upright.",
  linear: "Its model is linear and always the same: that of the upright robot at rest.",
  lqr: "The torque is u = -K x, clipped to the torque's bounds; it plans nothing and knows no other bound.",
  plan: "The states that the controller expects over the horizon of N samples (dashed).",
  activeBound: "Bounds that the plan touches: without them, it would go further there.",
  cost: "What the controller minimises: squared errors and torques over the plan, weighted with Q and R.",
  step: "Computing time of one control step, in your browser.",
} as const;

/** The words in the order in which they are explained. */
export const WORDS: [word: string, meaning: string][] = [
  ["phi", TERMS.phi],
  ["theta", TERMS.theta],
  ["x and y plane", TERMS.plane],
  ["torque", TERMS.torque],
  ["MPC", TERMS.mpc],
  ["LPV MPC", TERMS.lpv],
  ["linear MPC", TERMS.linear],
  ["LQR", TERMS.lqr],
  ["plan", TERMS.plan],
  ["active bound", TERMS.activeBound],
  ["cost J", TERMS.cost],
  ["time per step", TERMS.step],
];
