// The keyboard: everywhere but where a key means something else.

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

/** Here every key may be meant for the field. */
const FIELDS = "select, textarea, input:not([type=radio], [type=checkbox], [type=range])";
/** Here the space bar has a meaning of its own; a radio button that is chosen already has none for it. */
const TAKE_SPACE = "button, summary, input[type=checkbox], input[type=radio]:not(:checked)";

/** With these the key is the browser's or the system's. */
function isShortcut({ ctrlKey, metaKey, altKey }: KeyboardEvent): boolean {
  return ctrlKey || metaKey || altKey;
}

export function connectKeys(scene: HTMLElement, actions: KeyActions): void {
  scene.addEventListener("keydown", (event) => {
    const arrow = ARROWS[event.key];
    if (!arrow || isShortcut(event)) return;
    event.preventDefault();
    const [x, y] = arrow;
    if (event.shiftKey) actions.push(x * PUSH, y * PUSH);
    else actions.moveTarget(x * MOVE, y * MOVE);
  });
  document.addEventListener("keydown", (event) => {
    const { target } = event;
    const key = event.key.toLowerCase();
    const elsewhere = target instanceof HTMLElement && target.closest(key === " " ? `${FIELDS}, ${TAKE_SPACE}` : FIELDS);
    // What is behind an open dialogue is out of reach.
    if (elsewhere || isShortcut(event) || document.querySelector("dialog[open]")) return;
    if (key === " ") actions.toggle();
    else if (key === ".") actions.step();
    else if (key === "r") actions.reset();
    else return;
    event.preventDefault();
  });
}
