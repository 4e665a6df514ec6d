// What decides: the controller's own numbers, and the feedback pipeline around it on a real robot.

import { kindOf, type Scenario } from "../scenario";
import { TERMS } from "../terms";
import { numberField } from "./fields";
import type { Form } from "./form";

const STATES = ["phi", "theta", "phi_dot", "theta_dot"];
/** The largest number of sub-steps the slider offers; the field takes any. */
const SUBSTEPS = 8;

export function controllerFields(form: Form): HTMLElement[] {
  const weight = { min: 0.01, max: 10000, logarithmic: true };
  return [
    form.number("controller.horizon", { label: "Horizon N", unit: "samples", min: 1, max: 200, step: 1 }),
    form.number("controller.t_s", { label: "Sampling t_s", unit: "ms", factor: 1e-3, min: 1, max: 100, logarithmic: true }),
    ...STATES.map((name, i) => form.number(`controller.q.${i}`, { label: `Q ${name}`, ...weight })),
    form.number("controller.r", { label: "R", min: 1, max: 100000, logarithmic: true }),
    terminal(form),
    ...predictor(form),
    programs(form),
    form.check("controller.preview", { label: "Sees the reference ahead", absent: true }),
  ];
}

/** Quadratic programs per sample: at most so many where each is an improvement, exactly so many with the paper's predictor. */
function programs(form: Form): HTMLElement {
  let table: { fixed?: number; descent?: { most?: number } } = {};
  const field = numberField(
    {
      label: "QPs",
      title:
        "Quadratic programs per sample. Each one improves the plan or is not taken, and the search ends when little is left to gain: then this is the most. With the paper's predictor and with a certified set it is their number. Empty: as usual, or as in the file",
      step: 1,
      cleared: () => form.change("controller.iterations", undefined),
    },
    (count) => form.change("controller.iterations", table.fixed !== undefined ? { fixed: count } : { descent: { ...table.descent, most: count } }),
  );
  form.watch(({ controller }) => {
    const frozen = kindOf(controller["predictor"]) === "rk4" || kindOf(controller.terminal) === "certified";
    // Where the set-up leaves the choice to the controller: which of the two it takes.
    table = (controller["iterations"] ?? (frozen ? { fixed: NaN } : {})) as typeof table;
    field.set(table.fixed ?? table.descent?.most ?? NaN);
  });
  return field.element;
}

const TERMINALS: [kind: string, text: string][] = [
  ["discrete_riccati", "cost of the LQR"],
  ["equality", "equality x_N = x_ref"],
  ["certified", "certified (guaranteed)"],
  ["none", "none"],
  ["continuous_riccati", "Riccati (paper)"],
  ["cost", "P of the file"],
];

function terminal(form: Form): HTMLElement {
  const known = form.remembered("controller.terminal", [["certified", { certified: {} }], ["continuous_riccati", { continuous_riccati: {} }]]);
  return form.choice(
    "controller.terminal",
    { label: "Terminal", title: "The certified set belongs to the built-in robot and to t_s = 50 ms" },
    TERMINALS,
    (value) => kindOf(value as string | object | undefined) ?? "discrete_riccati",
    (kind) => known(kind) ?? kind,
  );
}

const PREDICTORS: [kind: string, text: string][] = [
  ["stage_consistent", "stage-consistent"],
  ["exact", "frozen, exact"],
  ["rk4", "frozen, RK4 (paper)"],
];

/** The paper's predictor is the only one that does not choose its sub-steps itself. */
function predictor(form: Form): HTMLElement[] {
  const substeps = (setup: Scenario) => Object.values(setup.controller.predictor ?? {})[0] as { substeps?: number } | undefined;
  let chosen = "stage_consistent";
  const write = (kind: string, steps: number | undefined) =>
    form.change("controller.predictor", { [kind]: steps !== undefined ? { substeps: steps } : kind === "rk4" ? { substeps: 1 } : {} });
  const field = numberField(
    { label: "Sub-steps", title: "Runge-Kutta steps per sample; empty: chosen from the fastest pole", min: 1, max: SUBSTEPS, step: 1, cleared: () => write(chosen, undefined) },
    (value) => write(chosen, value),
  );
  form.watch((setup) => {
    chosen = kindOf(setup.controller.predictor) ?? "stage_consistent";
    field.set(substeps(setup)?.substeps ?? NaN);
  });
  const choice = form.choice(
    "controller.predictor",
    { label: "Predictor", title: "Whose scheduling the prediction takes: that of every Runge-Kutta stage, or that of the sample's beginning, frozen" },
    PREDICTORS,
    (value) => kindOf(value as string | object | undefined) ?? "stage_consistent",
    (kind) => ({ [kind]: kind === "rk4" ? { substeps: 1 } : {} }),
  );
  return [choice, field.element];
}

/** Estimator, delay, ramps, moves and motors. */
export function feedbackFields(form: Form): HTMLElement[] {
  return [
    estimator(form),
    form.number("controller.delay_s", { label: "Known delay", title: "The controller decides for the state at which its torque will act", unit: "ms", factor: 1e-3, min: 0, max: 60, step: 1, absent: 0 }),
    form.table("controller.shaping", { label: "Set points as smooth moves" }, { tilt_rad: 0.1, phi_dot_rad_s: 8 },
      form.number("controller.shaping.tilt_rad", { label: "Tilt", quantity: "tilt", min: 0, max: 0.35 }),
      form.number("controller.shaping.phi_dot_rad_s", { label: "Ball speed", quantity: "ballSpeed", min: 0, max: 30 })),
    form.table("controller.torque_rate", { label: "Bounded torque rate" }, { limit_nm_s: 20, weight: 1 },
      form.number("controller.torque_rate.limit_nm_s", { label: "Rate limit", unit: "N m/s", min: 1, max: 200, logarithmic: true, whenEmpty: Infinity }),
      form.number("controller.torque_rate.weight", { label: "Rate weight", min: 0.001, max: 1000, logarithmic: true })),
    form.table("controller.motors", { label: "Motor limits known", title: "For one plane. Two planes on shared motors run in `ballbot simulate`" }, { limit_nm: 2 },
      form.number("controller.motors.limit_nm", { label: "Each motor", unit: "N m", min: 0.1, max: 5, step: 0.1 }),
      form.number("controller.motors.yaw_reserve_nm", { label: "Yaw reserve", unit: "N m", min: 0, max: 2, step: 0.1, absent: 0 })),
  ];
}

function estimator(form: Form): HTMLElement {
  const key = (name: string) => `controller.estimator.${name}`;
  const known = form.remembered(key("disturbances"), [["none", "none"]]);
  const disturbances = form.choice(
    key("disturbances"),
    { label: "Finds", title: "Constants that then leave no error in phi" },
    [["default", "torque and tilt offset"], ["none", "nothing"], ["torque_and_tilt", "as in the file"]],
    (value) => kindOf(value as string | object | undefined) ?? "default",
    known,
  );
  return form.table("controller.estimator", { label: "Estimator (Kalman filter)" }, {},
    form.optional(key("phi_noise_rad"), { label: "Noise phi", quantity: "ball" }),
    form.optional(key("theta_noise_rad"), { label: "Noise theta", quantity: "tilt" }),
    form.optional(key("theta_dot_noise_rad_s"), { label: "Noise rate", quantity: "tiltRate" }),
    form.optional(key("phi_dot_drift_rad_s"), { label: "Drift phi_dot", quantity: "ballSpeed" }),
    form.optional(key("theta_dot_drift_rad_s"), { label: "Drift rate", quantity: "tiltRate" }),
    form.optional(key("outlier_deviations"), { label: "Outliers", title: "Readings further off than this many standard deviations are not believed" }),
    disturbances,
  );
}

export function boundFields(form: Form): HTMLElement[] {
  return [
    form.range("bounds.phi_rad", { label: "phi", title: TERMS.phi, quantity: "ball" }),
    form.range("bounds.theta_rad", { label: "theta", title: TERMS.theta, quantity: "tilt" }),
    form.range("bounds.phi_dot_rad_s", { label: "phi_dot", title: "How fast phi changes", quantity: "ballSpeed" }),
    form.range("bounds.theta_dot_rad_s", { label: "theta_dot", title: "How fast theta changes", quantity: "tiltRate" }),
    form.range("bounds.torque_nm", { label: "torque", title: TERMS.torque, unit: "N m" }),
  ];
}
