// Lines on the floor: the grid, and those whose points change.

import {
  BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, Line, LineBasicMaterial, LineSegments, Points, PointsMaterial,
} from "three";
import type { FloorPoint } from "./view";

/** Reach of the grid, m. */
const HALF = 12;
/** Points of the longest line; a plan has at most 1000 samples. */
export const LINE_POINTS = 2048;

/** A line on the floor whose points change. */
export class FloorLine {
  readonly object: Line | Points;
  private readonly positions: BufferAttribute;

  constructor(material: LineBasicMaterial | PointsMaterial, private readonly height: number) {
    const geometry = new BufferGeometry();
    this.positions = new BufferAttribute(new Float32Array(3 * LINE_POINTS), 3);
    this.positions.setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", this.positions);
    this.object = material instanceof PointsMaterial ? new Points(geometry, material) : new Line(geometry, material);
    this.object.frustumCulled = false;
  }

  set(count: number, point: (i: number) => FloorPoint, lane: number): void {
    const shown = Math.min(count, this.positions.count);
    for (let i = 0; i < shown; i++) {
      const { x, y } = point(i);
      this.positions.setXYZ(i, x, this.height, -(y + lane));
    }
    this.positions.needsUpdate = true;
    this.object.geometry.setDrawRange(0, shown);
  }

  dispose(): void {
    this.object.geometry.dispose();
    (this.object.material as LineBasicMaterial).dispose();
  }
}

export function gridLines(step: number, skip: number, colour: string, opacity: number): LineSegments {
  const points: number[] = [];
  const count = Math.round(HALF / step);
  for (let i = -count; i <= count; i++) {
    if (skip > 0 && i % skip === 0) continue;
    const at = i * step;
    points.push(at, 0, -HALF, at, 0, HALF, -HALF, 0, at, HALF, 0, at);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  const material = new LineBasicMaterial({ color: new Color(colour), transparent: true, opacity });
  const lines = new LineSegments(geometry, material);
  lines.position.y = 0.001;
  return lines;
}
