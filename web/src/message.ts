// A line for people at the lower edge of the page.

/** Something that can be done about it. */
export interface Offer {
  label: string;
  take(): void;
}

/** How long a message stays, ms. */
const STAYS = { error: 12_000, info: 3500 };

export class MessageBox {
  private timer = 0;

  constructor(private readonly host: HTMLElement) {}

  showError(error: unknown): void {
    this.show(error instanceof Error ? error.message : String(error), "error");
  }

  /** What can be done about it stays until it is done or something else is said. */
  show(text: string, kind: "error" | "info", offer?: Offer): void {
    this.host.textContent = text;
    this.host.className = `message ${kind}`;
    this.host.hidden = false;
    clearTimeout(this.timer);
    if (offer) {
      const button = document.createElement("button");
      button.textContent = offer.label;
      button.addEventListener("click", () => {
        this.host.hidden = true;
        offer.take();
      });
      this.host.append(button);
      return;
    }
    this.timer = window.setTimeout(() => (this.host.hidden = true), STAYS[kind]);
  }
}
