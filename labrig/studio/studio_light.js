// The light: what shines from when on, and how strongly. On patches it is a list of lights for each
// of them; in a scene, the levels of its lamps.

import { $, duration, field, seconds, short, tag, written } from "./studio_words.js";

const KNOWN = ["none", "D65", "A", "D50", "E", "FL2", "LED-B3", "450nm", "365nm"];

/** Changes of light of a place: when, and what it is called. */
export function changesOf(wish, place) {
  if (!wish.scene) {
    return wish.places[place].map((change) => {
      const isDark = change.light === "none" || change.strength === 0;
      const strength = change.strength ?? 1;
      const times = strength === 1 || isDark ? "" : ` × ${short(strength)}`;
      return { at_s: seconds(change.at), isDark, label: isDark ? "dark" : (change.light ?? "irradiance") + times };
    });
  }
  // A lamp that an entry does not name stays as it was.
  const levels = {};
  return wish.scene.programme.map((part) => {
    Object.assign(levels, part.lamps);
    const on = Object.entries(levels).filter(([, level]) => level > 0);
    const label = on.map(([name, level]) => (level === 1 ? name : `${name} × ${short(level)}`)).join(", ");
    return { at_s: part.at_s, isDark: !on.length, label: label || "dark" };
  });
}

/** Levels of all lamps of a scene from a change on. */
function levelsAt(wish, lamps, number) {
  const levels = Object.fromEntries(lamps.map((name) => [name, 0]));
  wish.scene.programme.slice(0, number + 1).forEach((part) => Object.assign(levels, part.lamps));
  return levels;
}

export class Light {
  constructor({ onWish, onChosen, timeShown, wishNow }) {
    Object.assign(this, { onWish, onChosen, timeShown, wishNow });
    for (const name of KNOWN) $("known-lights").append(new Option(name));
    $("add-light").addEventListener("click", () => this.#add());
    $("remove-light").addEventListener("click", () => this.#remove());
    $("light-at").addEventListener("change", (event) => {
      const at_s = event.target.valueAsNumber;
      if (Number.isFinite(at_s)) this.#change((change) => this.#timed(change, at_s));
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
    this.lamps = answer.scene?.lamps ?? [];
    this.name = answer.places[chosenPlace].name;
    this.chosen = Math.min(chosenLight, this.#entries.length - 1);
    const change = this.#entries[this.chosen];
    const several = answer.places.length > 1 && !wish.scene ? ` on ${this.name}` : "";
    $("light-title").textContent = `Light${several} from ${duration(this.#at_s(change))}`;
    set("light-at", String(Number(this.#at_s(change).toPrecision(6))));
    $("remove-light").disabled = this.#entries.length < 2;
    $("patch-light").hidden = Boolean(wish.scene);
    $("lamps").hidden = !wish.scene;
    if (wish.scene) this.#drawLamps();
    else {
      set("light-name", change.light ?? "");
      $("light-name").placeholder = change.irradiance ? `irradiance ${change.irradiance.join(", ")}` : "";
      set("light-strength", String(change.strength ?? 1));
      $("light-strength").disabled = change.light === "none";
    }
  }

  get #entries() {
    return this.wishNow().scene ? this.wishNow().scene.programme : this.wishNow().places[this.name];
  }

  #at_s(change) {
    return this.wishNow().scene ? change.at_s : seconds(change.at);
  }

  #timed(change, at_s) {
    return this.wishNow().scene ? { ...change, at_s } : { ...change, at: written(at_s) };
  }

  #drawLamps() {
    const box = $("lamps");
    if (box.childElementCount !== this.lamps.length) {
      box.replaceChildren(...this.lamps.map((name) => this.#lamp(name)));
    }
    const levels = levelsAt(this.wishNow(), this.lamps, this.chosen);
    for (const name of this.lamps) set(`lamp-${name}`, String(levels[name]));
  }

  #lamp(name) {
    const level = field("number", { id: `lamp-${name}`, min: 0, step: "any" });
    level.addEventListener("change", () => {
      if (!(level.valueAsNumber >= 0)) return;
      this.#change((change) => ({ ...change, lamps: { ...change.lamps, [name]: level.valueAsNumber } }));
    });
    const label = tag("label", `Level of ${name}`);
    label.append(level);
    return label;
  }

  #change(changed) {
    const changes = this.#entries.map((each, i) => (i === this.chosen ? changed(each) : each));
    this.#give(changes, changes[this.chosen]);
  }

  /** Gives the changes in the order of their times; the one that was edited stays chosen. */
  #give(changes, chosen) {
    const sorted = [...changes].sort((a, b) => this.#at_s(a) - this.#at_s(b));
    this.onWish((now) => {
      if (now.scene) now.scene.programme = sorted;
      else now.places[this.name] = sorted;
    }, sorted.indexOf(chosen));
  }

  #add() {
    const at_s = this.timeShown();
    const same = this.#entries.findIndex((each) => Math.abs(this.#at_s(each) - at_s) < 1e-6);
    if (same >= 0) {
      this.onChosen(same);
      return;
    }
    const before = changesOf(this.wishNow(), this.name).filter((each) => each.at_s < at_s).at(-1);
    const added = this.#timed(this.#turned(before?.isDark ?? true), at_s);
    this.#give([...this.#entries, added], added);
  }

  /** A light after darkness, and darkness after light. */
  #turned(isDark) {
    if (!this.wishNow().scene) return { light: isDark ? "D65" : "none" };
    return { lamps: Object.fromEntries(this.lamps.map((name) => [name, isDark ? 1 : 0])) };
  }

  #remove() {
    const kept = this.#entries.filter((_, i) => i !== this.chosen);
    this.#give(kept, kept[Math.max(0, this.chosen - 1)]);
  }
}

function set(id, value) {
  if (document.activeElement !== $(id)) $(id).value = value;
}
