// What a picture of the floor must be able to do, in three dimensions or two.

import type { Pose } from "../motion";

export interface FloorPoint {
  x: number;
  y: number;
}

/** Sizes of the drawn robot, m and rad. */
export interface Shape {
  ballRadius: number;
  wheelRadius: number;
  zenith: number;
  /** Of the wheels, from the robot's x axis, counter-clockwise seen from above. */
  azimuths: number[];
  centreOfMass: number;
}

export interface RobotPicture {
  pose: Pose;
  /** Poses along the last plan. */
  prediction: Pose[];
  /** Ball positions in the past, x and y in turn. */
  trail: Float32Array;
  /** The reference over the run, x and y in turn. */
  reference: Float32Array;
  /** Where the ball is to be now. */
  goal: FloorPoint;
  /** Sideways shift of this robot's lane, m. */
  lane: number;
  colour: string;
}

export interface Picture {
  robots: RobotPicture[];
  /** The drawn path or push, while the pointer is down. */
  stroke: FloorPoint[];
  strokeKind: "path" | "push";
  /** Above the floor, m. */
  strokeHeight: number;
  follow: FloorPoint;
}

export interface Theme {
  background: string;
  grid: string;
  gridStrong: string;
  ink: string;
  body: string;
  metal: string;
  ball: string;
  ballStripe: string;
  reference: string;
  dark: boolean;
}

export interface View {
  readonly kind: "3d" | "2d";
  readonly element: HTMLElement;
  /** `inSequence` says that the frame before this one was drawn, too. Returns whether the picture
   *  still moves by itself: the camera swings out or goes after a robot. */
  draw(picture: Picture, inSequence: boolean): boolean;
  setShape(shape: Shape): void;
  setTheme(theme: Theme): void;
  resize(): void;
  /** Lets the camera follow the pointer. */
  setCameraTool(on: boolean): void;
  /** The point under a point of the window, on the floor or at a height above it (m). */
  floorAt(clientX: number, clientY: number, height?: number): FloorPoint | undefined;
  /** Where a point above the floor appears in the window. */
  project(x: number, y: number, height: number): { clientX: number; clientY: number };
}

/** The robot of the paper, until the set-up's own is known. */
export const PAPER_SHAPE: Shape = {
  ballRadius: 0.12, wheelRadius: 0.05, zenith: Math.PI / 4, azimuths: [-Math.PI / 2, Math.PI / 6, (5 * Math.PI) / 6], centreOfMass: 0.3,
};

export function readTheme(): Theme {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  return {
    background: colour("--scene"),
    grid: colour("--grid"),
    gridStrong: colour("--grid-strong"),
    ink: colour("--ink"),
    body: colour("--body"),
    metal: colour("--metal"),
    ball: colour("--ball"),
    ballStripe: colour("--ball-stripe"),
    reference: colour("--reference"),
    dark: style.getPropertyValue("--dark").trim() === "1",
  };
}
