// What tells places on the floor: the axes at the origin, and numbers at whole metres.

import { CanvasTexture, Group, Sprite, SpriteMaterial, SRGBColorSpace } from "three";
import { Arrow } from "./arrow";
import { toScene } from "./robot";
import type { Theme } from "./view";

/** Length of the axes, m. */
const AXIS = 0.45;
/** Numbers reach this far from the middle, m. */
const REACH = 3;
/** They stand on lines so far before and left of the middle, m. */
const BEFORE = 0.5;
const LEFT = 1;
/** Height of a text in its own picture, px. */
const PIXELS = 44;

export class FloorScale {
  readonly group = new Group();
  private readonly axes = [new Arrow(0.006, false), new Arrow(0.006, false)] as const;
  private readonly names = [new Sprite(), new Sprite()] as const;
  private readonly numbers: Sprite[] = [];
  private readonly materials = new Map<string, SpriteMaterial>();
  private shown = "";
  private textHeight = 0.02;

  constructor(private theme: Theme) {
    this.axes[0].set(toScene(0, 0, 0.008), toScene(AXIS, 0, 0.008));
    this.axes[1].set(toScene(0, 0, 0.008), toScene(0, AXIS, 0.008));
    this.names[0].position.copy(toScene(AXIS + 0.06, 0, 0.01));
    this.names[1].position.copy(toScene(0, AXIS + 0.06, 0.01));
    for (let i = 0; i < 4 * REACH + 2; i++) this.numbers.push(new Sprite());
    // They stand on the floor, which would hide their lower half.
    for (const sprite of [...this.names, ...this.numbers]) sprite.center.set(0.5, 0);
    this.group.add(...this.axes.map(({ group }) => group), ...this.names, ...this.numbers);
    this.setTheme(theme);
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    for (const material of this.materials.values()) {
      material.map?.dispose();
      material.dispose();
    }
    this.materials.clear();
    this.shown = "";
    for (const axis of this.axes) axis.setColour(theme.reference);
    this.write(this.names[0], "x");
    this.write(this.names[1], "y");
  }

  /** Numbers around a point of the floor, m. Of y only where `withY`: robots side by side stand on
   *  lanes, each with its own zero. */
  show(x: number, y: number, withY: boolean): void {
    const [middleX, middleY] = [Math.round(x), Math.round(y)];
    const before = Math.round(2 * y) / 2 - BEFORE;
    const key = `${middleX} ${middleY} ${before} ${withY}`;
    if (key === this.shown) return;
    this.shown = key;
    for (let i = -REACH; i <= REACH; i++) {
      const [ofX, ofY] = [this.numbers[i + REACH], this.numbers[i + 3 * REACH + 1]];
      if (!ofX || !ofY) continue;
      this.write(ofX, `x = ${middleX + i} m`);
      ofX.position.copy(toScene(middleX + i, before, 0.005));
      // Not two numbers in one place.
      ofY.visible = withY && middleY + i !== before;
      if (!ofY.visible) continue;
      this.write(ofY, `y = ${middleY + i} m`);
      ofY.position.copy(toScene(middleX - LEFT, middleY + i, 0.005));
    }
  }

  /** Height of the texts, m at a distance of 1 m from the camera. */
  setTextHeight(height: number): void {
    this.textHeight = height;
    for (const sprite of [...this.names, ...this.numbers]) this.size(sprite);
  }

  private size(sprite: Sprite): void {
    const image = sprite.material.map?.image as HTMLCanvasElement | undefined;
    if (image) sprite.scale.set((this.textHeight * image.width) / image.height, this.textHeight, 1);
  }

  private write(sprite: Sprite, text: string): void {
    const made = this.materials.get(text) ?? this.material(text);
    this.materials.set(text, made);
    sprite.material = made;
    this.size(sprite);
  }

  private material(text: string): SpriteMaterial {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("2d");
    const font = `500 ${PIXELS * 0.75}px system-ui, sans-serif`;
    if (context) context.font = font;
    [canvas.width, canvas.height] = [Math.ceil(context?.measureText(text).width ?? 1) + 8, PIXELS];
    if (context) {
      context.font = font;
      context.textBaseline = "middle";
      context.fillStyle = this.theme.reference;
      context.fillText(text, 4, PIXELS / 2);
    }
    const map = new CanvasTexture(canvas);
    map.colorSpace = SRGBColorSpace;
    return new SpriteMaterial({ map, sizeAttenuation: false, depthWrite: false, fog: true });
  }
}
