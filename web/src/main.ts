// Puts the page together.

import "./style.css";
import drive from "../presets/drive.toml?raw";
import { App } from "./app";
import { choose, save } from "./files";
import { connectKeys } from "./keys";
import { poseAt, predictedPoses, type Pose } from "./motion";
import { Panel } from "./panel/panel";
import { Plots } from "./plots";
import { ROW } from "./protocol";
import { FlatView } from "./scene/flat";
import { Pointer, type Tool } from "./scene/pointer";
import { SolidView } from "./scene/solid";
import { readTheme, type FloorPoint, type RobotPicture, type View } from "./scene/view";
import { StatusList } from "./status";

/** Time between two updates of plots and words, ms. */
const SLOW = 60;
/** Lanes of robots side by side, m. */
const LANE = 0.6;
/** How far back the ball's way is drawn, s. */
const TRAIL = 25;
/** Points of a trail. */
const TRAIL_POINTS = 700;
/** Tilt rate per length of the dragged arrow, rad/s per m. */
const PUSH_PER_METRE = 10;
const SPEEDS: [number, string][] = [[1, "1\u00d7"], [0.5, "\u00bd\u00d7"], [0.25, "\u00bc\u00d7"], [0.1, "0.1\u00d7"], [0.02, "0.02\u00d7"]];
const HINTS: Record<Tool, string> = {
  target: "Click or drag on the floor: the robot goes there. Drag the robot: a push. Right button or two fingers: camera.",
  path: "Draw on the floor: the robot follows the line.",
  push: "Drag: the arrow is the push.",
  camera: "Drag to turn, wheel or two fingers to zoom.",
};

function byId<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no #${id}`);
  return found as T;
}

const messageBox = byId("message");
let messageTimer = 0;

function message(text: string, kind: "error" | "info"): void {
  messageBox.textContent = text;
  messageBox.className = `message ${kind}`;
  messageBox.hidden = false;
  clearTimeout(messageTimer);
  messageTimer = window.setTimeout(() => (messageBox.hidden = true), kind === "error" ? 12_000 : 3500);
}

const host = byId("scene");

function makeView(): View {
  const theme = readTheme();
  // `?flat` shows the fallback on purpose.
  if (!new URLSearchParams(location.search).has("flat")) {
    try {
      return new SolidView(host, theme);
    } catch {
      host.replaceChildren();
    }
  }
  message("No WebGL here: the floor is shown from above.", "info");
  return new FlatView(host, theme);
}

const view = makeView();
document.body.classList.add(`view-${view.kind}`);
const plots = new Plots(byId("plots"));
const status = new StatusList(byId("status"));
const playButton = byId<HTMLButtonElement>("play");
const alertBox = byId("alert");
let panel: Panel | undefined;
let trails: Float32Array[] = [];
let references: Float32Array[] = [];
const kept = { bounds: "", shape: "" };

const colourOf = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function restarted(): void {
  const shown = app.histories.map((history, i) => ({ history, colour: colourOf(app.robots[i]?.colour ?? "--robot-lpv") }));
  plots.setRobots(shown, app.setup.bounds);
  byId("planes").hidden = app.planes === 1;
  trails = [];
  alertBox.hidden = true;
  const legend = byId("legend");
  legend.replaceChildren(...app.robots.map(({ label, colour }) => swatch(label, `dot ${colour.slice(2)}`)));
  legend.append(swatch("reference", "dash reference"), swatch("plan", "dash plan"), swatch("outside the bounds", "box outside"));
}

function swatch(text: string, className: string): HTMLElement {
  const made = document.createElement("span");
  made.className = className;
  made.textContent = text;
  return made;
}

function setupShown(): void {
  const { setup } = app;
  byId("title").textContent = app.playback ? `recorded: ${app.playbackName}` : setup.title;
  panel?.show(setup, app.preset, app.robots.map(({ name }) => name));
  plots.setBounds(setup.bounds);
  const p = setup.parameters;
  const shape = {
    ballRadius: p.ball_radius_m,
    wheelRadius: p.wheel_radius_m,
    zenith: (p.zenith_angle_deg * Math.PI) / 180,
    centreOfMass: p.centre_of_mass_m,
  };
  const key = JSON.stringify(shape);
  if (key !== kept.shape) {
    kept.shape = key;
    view.setShape(shape);
  }
}

function runningShown(): void {
  playButton.textContent = app.isRunning ? "Pause" : "Run";
  playButton.setAttribute("aria-pressed", String(app.isRunning));
  if (app.isComplete && !app.isRunning) message(app.playback ? "End of the recording." : "End of the scenario. Run goes on from here, Reset starts again.", "info");
}

const app = new App(
  { message, setup: setupShown, restarted, running: runningShown },
  [{ name: "drive", text: drive }],
);

function lane(index: number): number {
  return (index - (app.histories.length - 1) / 2) * LANE;
}

function radius(): number {
  return app.setup.parameters.ball_radius_m;
}

/** The way on the floor for an angle of the ball, to the millimetre. */
function metres(phi: number): number {
  return Math.round(phi * radius() * 1000) / 1000;
}

function robotPoint(): FloorPoint {
  const history = app.histories[0];
  if (!history) return { x: 0, y: 0 };
  const { x, y } = poseAt(history, app.time(), radius());
  return { x, y: y + lane(0) };
}

function sendTo(point: FloorPoint): void {
  app.target({ x: point.x, y: app.planes === 2 ? point.y : 0 });
}

const pointer = new Pointer(view, {
  target: ({ x, y }) => sendTo({ x, y: y - lane(0) }),
  path: (points) => {
    const flat = points.map(({ x, y }) => ({ x, y: app.planes === 2 ? y - lane(0) : 0 }));
    const { x, y } = robotPoint();
    app.path(flat, { x, y: app.planes === 2 ? y - lane(0) : 0 });
  },
  push: ({ x, y }) => app.push({ x: x * PUSH_PER_METRE, y: y * PUSH_PER_METRE }),
  robot: robotPoint,
});

/** The ball's way and the references, thinned for drawing. */
function updateLines(time: number): void {
  const r = radius();
  trails = app.histories.map((history) => {
    const from = history.indexAt(time - TRAIL);
    const until = history.indexAt(time);
    const stride = Math.max(Math.ceil((until - from) / TRAIL_POINTS), 1);
    const points: number[] = [];
    for (let i = from; i < until; i += stride) {
      points.push(history.at(i, 0, ROW.phi) * r, history.planes === 2 ? history.at(i, 1, ROW.phi) * r : 0);
    }
    return Float32Array.from(points);
  });
  references = app.references.map(([x, y]) => {
    const points = new Float32Array(2 * (x?.length ?? 0));
    for (let i = 0; i < (x?.length ?? 0); i++) {
      points[2 * i] = (x?.[i] ?? 0) * r;
      points[2 * i + 1] = (y?.[i] ?? 0) * r;
    }
    return points;
  });
}

function pictures(time: number): { robots: RobotPicture[]; poses: Pose[] } {
  const r = radius();
  const poses = app.histories.map((history) => poseAt(history, time, r));
  const robots = app.histories.map((history, i): RobotPicture => {
    const pose = poses[i] as Pose;
    const trail = trails[i] ?? new Float32Array(0);
    const joined = new Float32Array(trail.length + 2);
    joined.set(trail);
    joined.set([pose.x, pose.y], trail.length);
    return {
      pose,
      prediction: history.ending === undefined ? predictedPoses(history, r) : [],
      trail: joined,
      reference: references[i] ?? new Float32Array(0),
      goal: { x: history.nowAt(0, 5) * r, y: history.planes === 2 ? history.nowAt(1, 5) * r : 0 },
      lane: lane(i),
      colour: colourOf(app.robots[i]?.colour ?? "--robot-lpv"),
    };
  });
  return { robots, poses };
}

function showWords(): void {
  status.show(app.histories.map((history, i) => ({
    label: app.robots[i]?.label ?? "",
    colour: app.robots[i]?.colour ?? "--robot-lpv",
    history,
  })));
  const fallen = app.histories.flatMap(({ ending }, i) => (ending === undefined ? [] : [`${app.robots[i]?.label}: ${ending}`]));
  const text = fallen.join("\n");
  if (alertBox.textContent !== text) alertBox.textContent = text;
  alertBox.hidden = text === "";
  const target = app.histories[0];
  if (target) panel?.showTarget(metres(target.nowAt(0, 5)), target.planes === 2 ? metres(target.nowAt(1, 5)) : 0);
}

let lastSlow = 0;

function frame(now: number): void {
  requestAnimationFrame(frame);
  if (app.histories.length === 0) return;
  const time = app.time();
  if (now - lastSlow > SLOW) {
    lastSlow = now;
    updateLines(time);
    plots.draw(time);
    showWords();
    byId("clock").textContent = `${time.toFixed(2)} s`;
  }
  const { robots, poses } = pictures(time);
  const mean = (value: (pose: Pose) => number) => poses.reduce((sum, pose) => sum + value(pose), 0) / poses.length;
  view.draw({
    robots,
    stroke: pointer.stroke,
    strokeKind: pointer.strokeKind,
    follow: { x: mean(({ x }) => x), y: mean(({ y }) => y) },
  });
}

async function openFiles(files: File[]): Promise<void> {
  const read = await Promise.all(files.map(async (file) => ({ name: file.name, text: await file.text() })));
  const toml = read.find(({ name }) => name.toLowerCase().endsWith(".toml"));
  const csv = read.filter(({ name }) => name.toLowerCase().endsWith(".csv"));
  if (toml) await app.openToml(toml.text, "");
  else if (csv.length > 0) app.play(csv);
  else if (read.length > 0) message(`${read[0]?.name}: this is neither a set-up (.toml) nor a recorded run (.csv)`, "error");
}

async function copyLink(): Promise<void> {
  const address = new URL(location.href);
  address.hash = await app.fragment();
  history.replaceState(null, "", address);
  try {
    await navigator.clipboard.writeText(address.href);
    message("The link is in the clipboard and in the address bar.", "info");
  } catch {
    message("The link is in the address bar.", "info");
  }
}

function connectControls(): void {
  playButton.addEventListener("click", () => app.run(!app.isRunning));
  byId("step").addEventListener("click", () => app.step());
  byId("reset").addEventListener("click", () => app.reset());
  const speed = byId<HTMLSelectElement>("speed");
  for (const [value, text] of SPEEDS) speed.add(new Option(text, String(value)));
  speed.addEventListener("change", () => app.run(app.isRunning, Number(speed.value)));
  for (const input of document.querySelectorAll<HTMLInputElement>("input[name=tool]")) {
    input.addEventListener("change", () => {
      pointer.tool = input.value as Tool;
      view.setCameraTool(input.value === "camera");
      byId("hint").textContent = HINTS[pointer.tool];
    });
  }
  for (const input of document.querySelectorAll<HTMLInputElement>("input[name=plane]")) {
    input.addEventListener("change", () => plots.setPlane(Number(input.value)));
  }
  byId("hint").textContent = HINTS.target;
  const toggle = byId("panel-toggle");
  toggle.addEventListener("click", () => {
    const hidden = document.body.classList.toggle("no-panel");
    toggle.setAttribute("aria-expanded", String(!hidden));
    resized();
  });
  window.addEventListener("dragover", (event) => event.preventDefault());
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    void openFiles([...(event.dataTransfer?.files ?? [])]);
  });
  window.addEventListener("hashchange", () => void app.openLink(location.hash.slice(1)));
  connectKeys(host, {
    toggle: () => app.run(!app.isRunning),
    step: () => app.step(),
    reset: () => app.reset(),
    moveTarget: (dx, dy) => {
      const first = app.histories[0];
      if (first) sendTo({ x: first.nowAt(0, 5) * radius() + dx, y: (first.planes === 2 ? first.nowAt(1, 5) * radius() : 0) + dy });
    },
    push: (x, y) => app.push({ x, y }),
  });
}

function resized(): void {
  view.resize();
  plots.resize();
}

async function start(): Promise<void> {
  connectControls();
  new ResizeObserver(resized).observe(host);
  new ResizeObserver(resized).observe(byId("plots"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    view.setTheme(readTheme());
    restarted();
  });
  await app.start(location.hash.slice(1));
  panel = new Panel(byId("panel"), app.presets.map(({ name, text }) => [name, titleOf(text, name)]), {
    preset: (name) => void app.openPreset(name),
    change: (path, value) => void app.change(path, value),
    robots: (names) => void app.chooseRobots(names),
    target: (x, y) => sendTo({ x, y }),
    push: (x, y) => app.push({ x, y }),
    openFiles: () => void choose(".toml,.csv", true).then(openFiles),
    saveToml: () => save("scenario.toml", app.toml(), "application/toml"),
    saveCsv: () => {
      for (const { name, text } of app.csv()) save(name, text, "text/csv");
    },
    copyLink: () => void copyLink(),
  });
  panel.remember(app.setup);
  setupShown();
  runningShown();
  document.documentElement.dataset["ready"] = "true";
  requestAnimationFrame(frame);
}

/** The title in a scenario file, for the list. */
function titleOf(toml: string, name: string): string {
  return /^title\s*=\s*"(.*)"/m.exec(toml)?.[1] ?? name;
}

// A browser whose controller cannot be loaded says so in the page.
start().catch((error: unknown) => message(String(error), "error"));
