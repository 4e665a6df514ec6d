// The floor in three dimensions.

import {
  CircleGeometry, Color, DirectionalLight, Fog, HemisphereLight, LineBasicMaterial, LineSegments, Mesh,
  MeshLambertMaterial, PCFShadowMap, PerspectiveCamera, Plane, Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Actor } from "./actor";
import { Arrow } from "./arrow";
import { FloorLine, gridLines } from "./lines";
import { toScene } from "./robot";
import { FloorScale } from "./scale";
import { PAPER_SHAPE, type FloorPoint, type Picture, type Shape, type Theme, type View } from "./view";

/** How fast the camera goes after the robots, 1/s. */
const FOLLOW_RATE = 3.5;
/** A camera that moves by less in a frame stands still, m. */
const STILL = 1e-4;
/** Time between two frames as a rule, ms. */
const FRAME = 1000 / 60;
/** Height of numbers on the floor, px. */
const TEXT = 15;
/** Frames further apart are too slow, ms. */
const SLOW_FRAME = 40;
/** For how long frames may be slow, ms. */
const PATIENCE = 1500;

export class SolidView implements View {
  readonly kind = "3d";
  readonly element: HTMLCanvasElement;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(36, 1, 0.05, 60);
  private readonly controls: OrbitControls;
  private readonly sun = new DirectionalLight("#ffffff", 2.4);
  private readonly sky = new HemisphereLight("#ffffff", "#8a919c", 1.5);
  private readonly floor: Mesh<CircleGeometry, MeshLambertMaterial>;
  private grid: LineSegments[] = [];
  private actors: Actor[] = [];
  private stroke: FloorLine;
  private theme: Theme;
  private readonly push = new Arrow(0.014, true);
  private readonly scale: FloorScale;
  private shape = PAPER_SHAPE;
  private followed = new Vector3();
  private robots = 1;
  private slowFor = 0;
  private lastFrame = 0;

  /** Throws where there is no WebGL. */
  constructor(private readonly host: HTMLElement, theme: Theme) {
    this.theme = theme;
    this.renderer = new WebGLRenderer({ antialias: true, powerPreference: "high-performance" });
    this.element = this.renderer.domElement;
    host.append(this.element);
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.floor = new Mesh(new CircleGeometry(40, 48), new MeshLambertMaterial());
    this.floor.rotation.x = -Math.PI / 2;
    this.floor.receiveShadow = true;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.radius = 3;
    this.sun.shadow.bias = -0.0006;
    const box = this.sun.shadow.camera;
    [box.left, box.right, box.bottom, box.top, box.near, box.far] = [-1.6, 1.6, -1.6, 1.6, 0.5, 8];
    this.stroke = new FloorLine(new LineBasicMaterial({ color: new Color(theme.ink) }), 0.01);
    this.scale = new FloorScale(theme);
    this.scene.add(this.push.group, this.scale.group, this.floor, this.sun, this.sun.target, this.sky, this.stroke.object);
    this.camera.position.set(0.9, 1.35, 2.9);
    this.controls = new OrbitControls(this.camera, this.element);
    this.controls.target.set(0, 0.32, 0);
    this.controls.maxPolarAngle = Math.PI / 2 - 0.04;
    [this.controls.minDistance, this.controls.maxDistance] = [0.8, 14];
    this.controls.enableDamping = true;
    this.setCameraTool(false);
    this.setTheme(theme);
    this.resize();
  }

  setCameraTool(on: boolean): void {
    // Values of three's MOUSE and TOUCH: rotate 0, dolly 1, pan 2; two fingers dolly-rotate 3.
    this.controls.mouseButtons = { LEFT: on ? 0 : null, MIDDLE: 2, RIGHT: on ? 2 : 0 };
    this.controls.touches = { ONE: on ? 0 : null, TWO: 3 };
  }

  setShape(shape: Shape): void {
    this.shape = shape;
    this.clearActors();
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    const background = new Color(theme.background);
    this.scene.background = background;
    this.scene.fog = new Fog(background, 6, 15);
    this.floor.material.color = background.clone().multiplyScalar(theme.dark ? 0.9 : 0.97);
    this.sky.intensity = theme.dark ? 1.1 : 1.9;
    this.sky.groundColor = new Color(theme.dark ? "#20252c" : "#c3c8cf");
    this.sun.intensity = theme.dark ? 2.2 : 2.0;
    for (const lines of this.grid) {
      this.scene.remove(lines);
      lines.geometry.dispose();
      (lines.material as LineBasicMaterial).dispose();
    }
    this.grid = [gridLines(0.25, 4, theme.grid, 0.5), gridLines(1, 0, theme.gridStrong, 0.9)];
    this.scene.add(...this.grid);
    this.scale.setTheme(theme);
    this.push.setColour(theme.ballStripe);
    (this.stroke.object.material as LineBasicMaterial).color.set(theme.ink);
    this.clearActors();
  }

  private clearActors(): void {
    for (const actor of this.actors) actor.dispose();
    this.actors = [];
  }

  resize(): void {
    const { clientWidth, clientHeight } = this.host;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.scale.setTextHeight((TEXT * 2 * Math.tan((this.camera.fov * Math.PI) / 360)) / clientHeight);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
  }

  draw(picture: Picture, inSequence: boolean): boolean {
    const colours = picture.robots.map(({ colour }) => colour);
    if (colours.join() !== this.actors.map(({ colour }) => colour).join()) {
      this.clearActors();
      this.makeRoom(colours.length);
      this.actors = colours.map((colour) => new Actor(this.scene, this.shape, this.theme, colour));
    }
    for (const [i, robot] of picture.robots.entries()) this.actors[i]?.draw(robot);
    this.drawStroke(picture);
    const now = performance.now();
    // After a pause nothing is known of how fast frames are.
    const gap = inSequence ? now - this.lastFrame : FRAME;
    this.lastFrame = now;
    const followed = this.follow(picture.follow, gap);
    const turned = this.controls.update();
    this.adapt(gap);
    this.renderer.render(this.scene, this.camera);
    return followed > STILL || turned;
  }

  private drawStroke({ stroke, strokeKind, strokeHeight, robots }: Picture): void {
    const [from, to] = [stroke[0], stroke.at(-1)];
    const isPush = strokeKind === "push" && from !== undefined && to !== undefined;
    this.stroke.set(isPush ? 0 : stroke.length, (i) => stroke[i] ?? { x: 0, y: 0 }, 0);
    const height = Math.max(strokeHeight, 0.02);
    if (isPush) this.push.set(toScene(from.x, from.y, height), toScene(to.x, to.y, height));
    else this.push.group.visible = false;
    this.scale.show(this.followed.x, -this.followed.z, robots.length === 1);
  }

  /** The camera steps back for robots that come, and closer when they go. */
  private makeRoom(robots: number): void {
    const { position } = this.camera;
    position.sub(this.controls.target).multiplyScalar((2 + robots) / (2 + this.robots)).add(this.controls.target);
    this.robots = robots;
  }

  /** Camera, light and grid move along with the robots, `gap` ms after the last time. Returns how
   *  far, m. */
  private follow(point: FloorPoint, gap: number): number {
    const goal = toScene(point.x, point.y);
    const elapsed = Math.min(gap / 1000, 0.2);
    const step = goal.sub(this.followed).multiplyScalar(1 - Math.exp(-elapsed * FOLLOW_RATE));
    this.followed.add(step);
    this.camera.position.add(step);
    this.controls.target.add(step);
    this.sun.target.position.copy(this.followed);
    this.sun.position.copy(this.followed).add(new Vector3(-1.3, 3.4, 1.5));
    for (const lines of this.grid) {
      lines.position.x = Math.round(this.followed.x);
      lines.position.z = Math.round(this.followed.z);
    }
    this.floor.position.set(this.followed.x, 0, this.followed.z);
    return step.length();
  }

  /** Gives up shadows, then resolution, where the graphics cannot keep up. */
  private adapt(gap: number): void {
    this.slowFor = gap > SLOW_FRAME ? this.slowFor + gap : Math.max(this.slowFor - gap, 0);
    if (this.slowFor < PATIENCE) return;
    this.slowFor = 0;
    if (this.renderer.shadowMap.enabled) {
      this.renderer.shadowMap.enabled = false;
      this.sun.castShadow = false;
    } else if (this.renderer.getPixelRatio() > 0.75) {
      this.renderer.setPixelRatio(this.renderer.getPixelRatio() * 0.75);
      this.resize();
    }
  }

  floorAt(clientX: number, clientY: number, height = 0): FloorPoint | undefined {
    const box = this.element.getBoundingClientRect();
    const ray = new Raycaster();
    const place = new Vector2(
      ((clientX - box.left) / box.width) * 2 - 1,
      1 - ((clientY - box.top) / box.height) * 2,
    );
    ray.setFromCamera(place, this.camera);
    const hit = ray.ray.intersectPlane(new Plane(new Vector3(0, 1, 0), -height), new Vector3());
    if (!hit || hit.distanceTo(this.camera.position) > 30) return undefined;
    return { x: hit.x, y: -hit.z };
  }

  project(x: number, y: number, height: number): { clientX: number; clientY: number } {
    const box = this.element.getBoundingClientRect();
    const point = toScene(x, y, height).project(this.camera);
    return {
      clientX: box.left + ((point.x + 1) / 2) * box.width,
      clientY: box.top + ((1 - point.y) / 2) * box.height,
    };
  }
}
