// What stands where in the rows of numbers that the WebAssembly module hands out. The text of this
// file comes from crates/ballbot-web/src/layout.rs; `cargo test -p ballbot-web` compares them, and
// prints the file as it must be.

/** Columns of a row: one sample in one plane. */
export const ROW = {
  /** Unit: s. */
  time: 0,
  /** Unit: rad. */
  phi: 1,
  /** Unit: rad. */
  theta: 2,
  /** Unit: rad/s. */
  phiDot: 3,
  /** Unit: rad/s. */
  thetaDot: 4,
  /** Unit: N m. */
  torque: 5,
  /** Unit: rad. */
  phiReference: 6,
  /** Unit: 1. */
  cost: 7,
  /** Unit: count. */
  activeBounds: 8,
  /** Unit: us. */
  stepMicroseconds: 9,
  /** Unit: rad. */
  estimatePhi: 10,
  /** Unit: rad. */
  estimateTheta: 11,
  /** Unit: rad/s. */
  estimatePhiDot: 12,
  /** Unit: rad/s. */
  estimateThetaDot: 13,
} as const;
export const ROW_WIDTH = 14;

/** Columns of the state now, in one plane. */
export const NOW = {
  /** Unit: s. */
  time: 0,
  /** Unit: rad. */
  phi: 1,
  /** Unit: rad. */
  theta: 2,
  /** Unit: rad/s. */
  phiDot: 3,
  /** Unit: rad/s. */
  thetaDot: 4,
  /** Unit: rad. */
  phiReference: 5,
} as const;
export const NOW_WIDTH = 6;
