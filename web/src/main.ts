// Puts the page together.

import "./style.css";
import { App } from "./app";
import { connectControls, linkInAddress } from "./controls";
import { choose, readText, save } from "./files";
import { CAPACITY } from "./history";
import { MessageBox } from "./message";
import { byId } from "./page";
import { Panel } from "./panel/panel";
import { Pictures } from "./pictures";
import { Plots } from "./plots/plots";
import { PRESETS, titleOf } from "./presets";
import { connectReview } from "./review";
import { colourOf } from "./robots";
import { FlatView } from "./scene/flat";
import { Pointer } from "./scene/pointer";
import { SolidView } from "./scene/solid";
import { readTheme, type FloorPoint, type View } from "./scene/view";
import { endingsInWords, StatusList } from "./status";
import { connectExplanations } from "./explanations";
import { storedSystem, storeSystem, type UnitSystem } from "./units";

/** Time between two updates of plots and words, ms. */
const SLOW = 60;
/** Tilt rate per length of the dragged arrow, rad/s per m. */
const PUSH_PER_METRE = 10;

const messages = new MessageBox(byId("message"));
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
    messages.show("No WebGL here: the floor is shown from above.", "info");
  }
  return new FlatView(host, theme);
}

const view = makeView();
document.body.classList.add(`view-${view.kind}`);
const plots = new Plots(byId("plots"), () => redraw());
const status = new StatusList(byId("status"));
const app = new App({ message: (text, kind, offer) => messages.show(text, kind, offer), opened: () => panel?.opened(), setup: setupShown, restarted, running: runningShown, ended, asked });
const pictures = new Pictures(app);
let panel: Panel | undefined;
let shownShape = "";
let units = storedSystem();

function swatch(text: string, className: string): HTMLElement {
  const made = document.createElement("span");
  made.className = className;
  made.textContent = text;
  return made;
}

function restarted(): void {
  redraw();
  plots.setRobots(app.histories.map((history, i) => ({ history, colour: colourOf(app.robots[i]) })), app.setup.bounds);
  byId("planes").hidden = app.planes === 1;
  pictures.forget();
  byId("alert").hidden = true;
  const legend = byId("legend");
  legend.replaceChildren(...app.robots.map(({ label, colour }) => swatch(label, `dot ${colour.slice(2)}`)));
  legend.append(swatch("reference", "dash reference"), swatch("plan", "dash plan"), swatch("outside the bounds", "box outside"));
}

function setupShown(): void {
  redraw();
  const { setup } = app;
  byId("title").textContent = app.playback ? `recorded: ${app.playbackName}` : setup.title;
  panel?.show(setup, app.preset, app.robots.map(({ name }) => name));
  plots.setBounds(setup.bounds);
  showUnits();
  const { ball_radius_m: ballRadius, wheel_radius_m: wheelRadius, centre_of_mass_m: centreOfMass } = setup.parameters;
  const shape = { ballRadius, wheelRadius, centreOfMass, zenith: app.zenith, azimuths: app.azimuths };
  const key = JSON.stringify(shape);
  if (key !== shownShape) {
    shownShape = key;
    view.setShape(shape);
  }
}

function showUnits(): void {
  panel?.setUnits(units, app.radius);
  plots.setUnits(units, app.radius);
}

function chooseUnits(system: UnitSystem): void {
  units = system;
  storeSystem(system);
  showUnits();
  redraw();
}

function runningShown(): void {
  redraw();
  const play = byId("play");
  play.textContent = app.isRunning ? "Pause" : "Run";
  play.setAttribute("aria-pressed", String(app.isRunning));
}

function ended(): void {
  messages.show(app.playback ? "End of the recording. Run plays it again."
    : "End of the scenario. Run goes on from here, Reset starts again.", "info");
}

/** Until what came of it is seen the page is not settled. */
function asked(): void {
  document.documentElement.dataset["settled"] = "false";
  redraw();
}

/** Where the first robot is to go: the last target before it is heard of from the worker. */
function wanted(): FloorPoint {
  return app.ordered ?? pictures.firstTarget();
}

/** Sends it to a place that is found from where it is to go already. */
function sendTo(place: (target: FloorPoint) => FloorPoint): void {
  app.target(() => {
    const { x, y } = place(wanted());
    return { x, y: app.planes === 2 ? y : 0 };
  });
}

/** A point of the floor in the first robot's lane. */
function inLane({ x, y }: FloorPoint): FloorPoint {
  return { x, y: app.planes === 2 ? y - pictures.lane(0) : 0 };
}

const pointer = new Pointer(view, {
  target: (point) => app.target(() => inLane(point)),
  path: (points) => app.path(() => ({ points: points.map(inLane), from: inLane(pictures.robots()[0] ?? { x: 0, y: 0 }) })),
  push: ({ x, y }) => app.push({ x: x * PUSH_PER_METRE, y: y * PUSH_PER_METRE }),
  robots: () => pictures.robots(),
});

/** Statuses, reasons of falls, target, clock. */
function showWords(time: number): void {
  const past = app.isLookingBack ? time : undefined;
  const lines = app.histories.map((history, i) => ({
    label: app.robots[i]?.label ?? "",
    colour: app.robots[i]?.colour ?? "--robot-lpv",
    history,
  }));
  status.show(lines, past);
  const text = endingsInWords(lines, past);
  const alert = byId("alert");
  if (alert.textContent !== text) alert.textContent = text;
  alert.hidden = text === "";
  const target = wanted();
  // A target that was typed may still wait for a change.
  if (app.isSettled) panel?.showTarget(target.x / app.radius, target.y / app.radius);
  byId("clock").textContent = `${time.toFixed(2)} s`;
}

const showReview = connectReview(app, redraw);
let lastSlow = 0;
/** Something has happened that is not yet seen. */
let stale = true;
/** The picture moves by itself. */
let moving = false;
/** The last frame was drawn. */
let drawn = false;

function redraw(): void {
  stale = true;
}

function frame(now: number): void {
  requestAnimationFrame(frame);
  const inSequence = drawn;
  drawn = app.histories.length > 0 && (app.isRunning || stale || moving);
  if (!drawn) return;
  const time = app.time();
  if (now - lastSlow > SLOW) {
    lastSlow = now;
    stale = false;
    pictures.updateLines(time);
    plots.draw(time);
    showWords(time);
    showReview(plots.pointed);
    document.documentElement.dataset["settled"] = String(app.isAnswered);
  }
  const picture = { ...pictures.at(time), stroke: pointer.stroke, strokeKind: pointer.strokeKind, strokeHeight: pointer.strokeHeight };
  moving = view.draw(picture, inSequence);
}

async function openFiles(files: File[]): Promise<void> {
  const named = (ending: string) => files.filter(({ name }) => name.toLowerCase().endsWith(ending));
  const [[toml], csv] = [named(".toml"), named(".csv")];
  try {
    if (toml) await app.openToml((await readText(toml)).text, "");
    else if (csv.length > 0) await app.play(await Promise.all(csv.map(readText)));
    else if (files[0]) {
      const kinds = "neither a set-up (.toml) nor a recorded run (.csv); if it is a folder, choose the files in it";
      messages.show(`${files[0].name}: this is ${kinds}`, "error");
    }
  } catch (error) {
    messages.showError(error);
  }
}

function saveCsv(): void {
  for (const { name, text } of app.csv()) save(name, text, "text/csv");
  if (app.histories.some(({ total, length }) => total > length)) {
    messages.show(`The file holds the last ${CAPACITY} samples; what was before them is not kept.`, "info");
  }
}

async function copyLink(): Promise<void> {
  const address = new URL(location.href);
  try {
    address.hash = await app.fragment();
    history.replaceState(null, "", address);
  } catch (error) {
    messages.showError(error);
    return;
  }
  try {
    await navigator.clipboard.writeText(address.href);
    messages.show("The link is in the clipboard and in the address bar.", "info");
  } catch {
    messages.show("The link is in the address bar.", "info");
  }
}

function resized(): void {
  redraw();
  view.resize();
  plots.resize();
}

function makePanel(): Panel {
  return new Panel(byId("panel"), PRESETS.map((preset) => [preset.name, titleOf(preset)]), {
    preset: (name) => void app.openPreset(name),
    change: (path, value) => void app.change(path, value),
    robots: (names) => void app.chooseRobots(names),
    units: chooseUnits,
    target: (typed) => sendTo((target) => {
      const { x = target.x / app.radius, y = target.y / app.radius } = typed;
      return { x: x * app.radius, y: y * app.radius };
    }),
    push: (x, y) => app.push({ x, y }),
    openFiles: () => void choose(".toml,.csv", true).then(openFiles),
    saveToml: () => app.afterOrders(() => save("scenario.toml", app.toml(), "application/toml")),
    saveCsv: () => app.afterChanges(saveCsv),
    copyLink: () => app.afterOrders(() => void copyLink()),
  });
}

/** What makes a new picture necessary. */
function connectDrawing(): void {
  new ResizeObserver(resized).observe(host);
  new ResizeObserver(resized).observe(byId("plots"));
  // On a phone the scene stays below the bar, however many lines that has.
  const bar = byId("bar");
  new ResizeObserver(() => document.documentElement.style.setProperty("--bar", `${bar.offsetHeight}px`)).observe(bar);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    view.setTheme(readTheme());
    restarted();
  });
  app.onBatch = redraw;
  for (const input of ["pointerdown", "pointermove", "pointerup", "pointercancel", "wheel", "keydown", "change"]) {
    window.addEventListener(input, redraw, { passive: true });
  }
  view.element.addEventListener("webglcontextrestored", redraw);
}

async function start(): Promise<void> {
  // Without a controller there is nothing to show or to do; the page says why.
  if (!(await app.start(linkInAddress()))) return;
  const moveTarget = (dx: number, dy: number) => sendTo(({ x, y }) => ({ x: x + dx, y: y + dy }));
  connectControls({ app, view, plots, pointer, resized, moveTarget, openFiles: (files) => void openFiles(files) });
  connectDrawing();
  connectExplanations();
  panel = makePanel();
  for (const id of ["play", "step", "reset"]) byId<HTMLButtonElement>(id).disabled = false;
  setupShown();
  runningShown();
  document.documentElement.dataset["ready"] = "true";
  requestAnimationFrame(frame);
}

start().catch((error: unknown) => messages.show(String(error), "error"));
