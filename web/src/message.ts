// A line for people at the lower edge of the page.

/** How long a message stays, ms. */
const STAYS = { error: 12_000, info: 3500 };

export class MessageBox {
  private timer = 0;

  constructor(private readonly host: HTMLElement) {}

  showError(error: unknown): void {
    this.show(error instanceof Error ? error.message : String(error), "error");
  }

  show(text: string, kind: "error" | "info"): void {
    this.host.textContent = text;
    this.host.className = `message ${kind}`;
    this.host.hidden = false;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => (this.host.hidden = true), STAYS[kind]);
  }
}
