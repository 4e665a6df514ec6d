// The world that the robot is in; the controller does not know of it.

import type { Form } from "./form";

export function worldFields(form: Form): HTMLElement[] {
  const factor = (key: string, label: string) =>
    form.number(`world.robot.${key}_factor`, { label, title: "The robot's value over the controller's", min: 0.5, max: 1.5, step: 0.01, absent: 1 });
  return [
    form.number("world.floor.slope_x_deg", { label: "Slope x", unit: "deg", min: -10, max: 10, step: 0.5, absent: 0 }),
    form.number("world.floor.slope_y_deg", { label: "Slope y", unit: "deg", min: -10, max: 10, step: 0.5, absent: 0 }),
    form.number("world.sensors.theta.noise_rad", { label: "Noise, angles", also: "world.sensors.phi.noise_rad", quantity: "tilt", min: 0, max: 0.035, absent: 0 }),
    form.number("world.sensors.theta_dot.noise_rad_s", { label: "Noise, rates", also: "world.sensors.phi_dot.noise_rad_s", quantity: "tiltRate", min: 0, max: 0.5, absent: 0 }),
    form.number("world.delay.transport_s", { label: "Delay", unit: "ms", factor: 1e-3, min: 0, max: 60, step: 1, absent: 0 }),
    factor("b1", "b1 factor"),
    factor("b2", "b2 factor"),
    factor("b3", "b3 factor"),
    factor("b4", "b4 factor"),
    factor("centre_of_mass", "l factor"),
    form.number("world.actuator.limit_nm", { label: "Torque limit", title: "What the drive delivers; empty: any torque", unit: "N m", whenEmpty: Infinity, absent: Infinity }),
    form.number("world.seed", { label: "Seed", title: "The same seed, the same noise", absent: 0 }),
  ];
}
