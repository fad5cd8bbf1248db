// The light of the chosen place: what shines from when on, and how strongly.

import { field } from "./studio_dots.js";
import { $, duration, seconds, tag, written } from "./studio_words.js";

const KNOWN = ["none", "D65", "A", "D50", "E", "FL2", "LED-B3", "450nm", "365nm"];

export class Light {
  constructor({ onChange, onChosen, timeShown, onSettled }) {
    Object.assign(this, { onChange, onChosen, timeShown, onSettled });
    const known = $("known-lights");
    for (const name of KNOWN) known.append(new Option(name));
    $("add-light").addEventListener("click", () => this.#add());
    $("remove-light").addEventListener("click", () => this.#remove());
    $("light-at").addEventListener("change", (event) => {
      const at = event.target.valueAsNumber;
      if (Number.isFinite(at)) this.#change((change) => ({ ...change, at: written(at) }));
    });
    $("light-name").addEventListener("change", (event) => {
      const light = event.target.value.trim();
      if (light) this.#change(({ irradiance, ...change }) => ({ ...change, light }));
    });
    $("light-strength").addEventListener("change", (event) => {
      const strength = event.target.valueAsNumber;
      if (strength >= 0) this.#change((change) => ({ ...change, strength }));
    });
  }

  draw({ answer, wish, chosenPlace, chosenLight }) {
    this.name = answer.places[chosenPlace].name;
    this.changes = wish.places[this.name];
    this.chosen = Math.min(chosenLight, this.changes.length - 1);
    const change = this.changes[this.chosen];
    const several = answer.places.length > 1 ? ` on ${this.name}` : "";
    $("light-title").textContent = `Light${several} from ${duration(seconds(change.at))}`;
    const set = (id, value) => {
      if (document.activeElement !== $(id)) $(id).value = value;
    };
    set("light-at", String(Number(seconds(change.at).toPrecision(6))));
    set("light-name", change.light ?? "");
    $("light-name").placeholder = change.irradiance ? `irradiance ${change.irradiance.join(", ")}` : "";
    set("light-strength", String(change.strength ?? 1));
    $("light-strength").disabled = change.light === "none";
    $("remove-light").disabled = this.changes.length < 2;
  }

  #change(changed) {
    const changes = this.changes.map((each, i) => (i === this.chosen ? changed(each) : each));
    this.#give(changes, changes[this.chosen]);
  }

  /** Changes in the order of their times; the one that was edited stays chosen. */
  #give(changes, chosen) {
    const sorted = [...changes].sort((a, b) => seconds(a.at) - seconds(b.at));
    this.onChosen(sorted.indexOf(chosen));
    this.onChange(this.name, sorted);
  }

  #add() {
    const at = this.timeShown();
    if (this.changes.some((each) => Math.abs(seconds(each.at) - at) < 1e-6)) {
      this.onChosen(this.changes.findIndex((each) => Math.abs(seconds(each.at) - at) < 1e-6));
      return;
    }
    const before = this.changes.filter((each) => seconds(each.at) < at).at(-1);
    const added = { at: written(at), light: before && before.light === "none" ? "D65" : "none" };
    this.#give([...this.changes, added], added);
  }

  #remove() {
    const kept = this.changes.filter((_, i) => i !== this.chosen);
    this.#give(kept, kept[Math.max(0, this.chosen - 1)]);
  }
}
