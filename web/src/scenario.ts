// The set-up as the page holds it: the scenario file of ballbot-scenario, key by key, and the
// text of the TOML file that `ballbot simulate` reads. What a key means, and whether its value
// makes sense, only the Rust side says.

export type Range = [number, number];

export interface Parameters {
  b1_m2: number;
  b2_m2: number;
  b3_m2: number;
  b4_m2_s: number;
  drive_friction_m2_s?: number;
  drive_coulomb_m2_s2?: number;
  centre_of_mass_m: number;
  ball_radius_m: number;
  wheel_radius_m: number;
  gravity_m_s2: number;
  zenith_angle_deg?: number;
}

export interface Point {
  time_s: number;
  phi_rad: number;
}

export type Reference =
  | { set_points: { points: Point[] } }
  | { lines: { points: Point[] } }
  | { minimum_jerk: { points: Point[] } }
  | { planes: { x: Reference; y: Reference } }
  | { [kind: string]: unknown };

export type Terminal = string | { [kind: string]: unknown };

export interface Scenario {
  title: string;
  duration_s: number;
  parameters: Parameters;
  controller: {
    model: "lpv" | "linear";
    t_s: number;
    horizon: number;
    q: [number, number, number, number];
    r: number;
    terminal?: Terminal;
    predictor?: string | { [kind: string]: unknown };
    [key: string]: unknown;
  };
  bounds: {
    phi_rad?: Range;
    theta_rad?: Range;
    phi_dot_rad_s?: Range;
    theta_dot_rad_s?: Range;
    torque_nm: Range;
  };
  reference: Reference;
  [key: string]: unknown;
}

/** The kind of an enum value: its only key, or the string itself. */
export function kindOf(value: string | object | undefined): string | undefined {
  return typeof value === "object" ? Object.keys(value)[0] : value;
}

/** The value at a path such as "controller.q.0"; `undefined` where the path leads nowhere. */
export function valueAt(root: unknown, path: string): unknown {
  let place = root;
  for (const key of path.split(".")) {
    if (typeof place !== "object" || place === null) return undefined;
    place = (place as Record<string, unknown>)[key];
  }
  return place;
}

/** A copy of `root` with `value` at `path`; tables on the way are made, `undefined` deletes. */
export function withValue<T>(root: T, path: string, value: unknown): T {
  const copy = structuredClone(root);
  const keys = path.split(".");
  const last = keys.pop() as string;
  let place = copy as Record<string, unknown>;
  for (const key of keys) {
    if (typeof place[key] !== "object" || place[key] === null) place[key] = {};
    place = place[key] as Record<string, unknown>;
  }
  if (value === undefined) delete place[last];
  else place[last] = value;
  return copy;
}

type Table = Record<string, unknown>;

function isTable(value: unknown): value is Table {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function inline(value: unknown): string {
  if (typeof value === "number") {
    // Written with all its digits, a large float would be an integer, and none that can be read.
    if (Number.isFinite(value)) return Number.isInteger(value) && !Number.isSafeInteger(value) ? value.toExponential() : String(value);
    return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  }
  if (typeof value === "string") return JSON.stringify(value);
  if (Array.isArray(value)) return `[${value.map(inline).join(", ")}]`;
  if (isTable(value)) {
    const entries = Object.entries(value).filter(([, entry]) => entry !== undefined);
    return `{ ${entries.map(([key, entry]) => `${key} = ${inline(entry)}`).join(", ")} }`;
  }
  return String(value);
}

function writeTable(table: Table, path: string[], lines: string[]): void {
  const entries = Object.entries(table).filter(([, value]) => value !== undefined);
  const plain = entries.filter(([, value]) => !isTable(value));
  if (path.length > 0 && (plain.length > 0 || entries.length === 0)) {
    lines.push("", `[${path.join(".")}]`);
  }
  for (const [key, value] of plain) {
    if (Array.isArray(value) && value.some(isTable)) {
      lines.push(`${key} = [`, ...value.map((entry) => `    ${inline(entry)},`), "]");
    } else {
      lines.push(`${key} = ${inline(value)}`);
    }
  }
  for (const [key, value] of entries) {
    if (isTable(value)) writeTable(value, [...path, key], lines);
  }
}

/** The TOML file. */
export function toToml(scenario: Scenario): string {
  const lines: string[] = [];
  writeTable(scenario as unknown as Table, [], lines);
  return `${lines.join("\n")}\n`;
}
