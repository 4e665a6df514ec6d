// What the words on the page mean, beside a picture of the robot.

import { byId } from "./page";
import { WORDS } from "./terms";

export function connectExplanations(): void {
  const dialog = byId<HTMLDialogElement>("explanations");
  for (const [word, meaning] of WORDS) {
    const [term, sentence] = [document.createElement("dt"), document.createElement("dd")];
    [term.textContent, sentence.textContent] = [word, meaning];
    byId("words").append(term, sentence);
  }
  byId("explain").addEventListener("click", () => dialog.showModal());
  // A press beside it is one on its backdrop.
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
}
