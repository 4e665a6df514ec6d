// The keyboard: everywhere but in a field.

export interface KeyActions {
  toggle(): void;
  step(): void;
  reset(): void;
  moveTarget(dx: number, dy: number): void;
  push(x: number, y: number): void;
}

/** An arrow key moves the target by this much, m. */
const MOVE = 0.25;
/** Shift and an arrow key push by this much, rad/s. */
const PUSH = 3;

const ARROWS: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

export function connectKeys(scene: HTMLElement, actions: KeyActions): void {
  scene.addEventListener("keydown", (event) => {
    const arrow = ARROWS[event.key];
    if (!arrow) return;
    event.preventDefault();
    const [x, y] = arrow;
    if (event.shiftKey) actions.push(x * PUSH, y * PUSH);
    else actions.moveTarget(x * MOVE, y * MOVE);
  });
  document.addEventListener("keydown", (event) => {
    const { target } = event;
    const elsewhere = target instanceof HTMLElement && target.closest("input, select, button, summary, a");
    if (elsewhere || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") actions.toggle();
    else if (event.key === ".") actions.step();
    else if (event.key === "r") actions.reset();
    else return;
    event.preventDefault();
  });
}
