// The list of keys: what is wanted when, what comes out, and the fields of the chosen one.

import { besides, shown } from "./studio_colour.js";
import { ofWhite, swatch, wantedLuminance, withColour, withLuminance } from "./studio_keys.js";
import { $, duration, field, seconds, tag, written } from "./studio_words.js";

const [FAINTEST, BRIGHTEST] = [-8, 1];

function labelled(text, field) {
  const label = tag("label", text);
  label.append(field);
  return label;
}

export class Keys {
  constructor({ onChosen, onChange, onRemove, onSettled }) {
    Object.assign(this, { onChosen, onChange, onRemove, onSettled });
  }

  draw({ answer, wish, chosen }) {
    const list = $("keys");
    $("no-keys").hidden = wish.keys.length > 0;
    const focused = [...list.querySelectorAll("button")].indexOf(document.activeElement);
    list.replaceChildren(
      ...wish.keys.map((key, i) => this.#row(key, answer.keys[i], i, chosen, answer)),
    );
    list.querySelectorAll("button")[focused]?.focus();
    this.#editor(wish, answer, chosen);
  }

  #row(key, judged, i, chosen, answer) {
    const row = tag("li", undefined, i === chosen ? "chosen" : "");
    const button = tag("button", undefined, "row");
    button.type = "button";
    button.setAttribute("aria-pressed", String(i === chosen));
    const wanted = tag("i", undefined, "swatch");
    const got = tag("i", undefined, "swatch");
    if (judged) {
      // Side by side at the exposure at which the wanted one is shown well.
      wanted.style.background = shown(judged.wanted);
      got.style.background = besides(judged.wanted, judged.got);
    }
    const pair = tag("span", undefined, "pair");
    pair.append(wanted, got);
    pair.title = "wanted and got";
    const where = answer.places.length > 1 && judged ? ` · ${answer.places[judged.place].name}` : "";
    const said = judged ? `ΔE ${judged.delta_e.toFixed(1)}` : "";
    const difference = tag("b", said, judged && judged.delta_e > 2 ? "missed" : "");
    button.append(tag("em", String(i + 1)), pair, tag("span", duration(seconds(key.at)) + where), difference);
    button.addEventListener("click", () => this.onChosen(i));
    row.append(button);
    return row;
  }

  #editor(wish, answer, chosen) {
    const box = $("key");
    box.hidden = !(chosen in wish.keys);
    if (box.hidden) return;
    const key = wish.keys[chosen];
    const judged = answer.keys[chosen];
    const signature = JSON.stringify([chosen, answer.places.map((place) => place.name)]);
    if (box.dataset.of !== signature) this.#build(box, signature, wish, answer, chosen);
    const set = (id, value) => {
      const input = $(id);
      if (input && document.activeElement !== input) input.value = value;
    };
    $("key-title").textContent = `Key ${chosen + 1}`;
    set("key-time", String(Number(seconds(key.at).toPrecision(6))));
    set("key-colour", swatch(key, judged));
    const y = wantedLuminance(key, judged);
    const slider = $("key-luminance");
    if (document.activeElement !== slider || !slider.matches(":active")) {
      slider.value = String(y > 0 ? Math.log10(y) : FAINTEST);
    }
    $("key-luminance-said").textContent = ofWhite(y);
    const place = $("key-place");
    if (place) place.value = key.place ?? answer.places[0].name;
  }

  #build(box, signature, wish, answer, chosen) {
    box.dataset.of = signature;
    const head = tag("div", undefined, "head");
    const title = tag("h3");
    title.id = "key-title";
    const remove = tag("button", "Remove");
    remove.type = "button";
    remove.addEventListener("click", () => this.onRemove(chosen));
    head.append(title, remove);
    const time = field("number", { id: "key-time", step: "any" });
    time.addEventListener("change", () => {
      if (time.value === "" || !Number.isFinite(time.valueAsNumber)) return;
      this.onChange(chosen, (key) => ({ ...key, at: written(time.valueAsNumber) }));
    });
    const colour = field("color", { id: "key-colour" });
    colour.addEventListener("input", () => {
      this.onChange(
        chosen,
        (key, judged) => withColour(key, judged, colour.value),
        `colour ${chosen}`,
      );
    });
    colour.addEventListener("change", () => this.onSettled());
    const bright = field("range", { id: "key-luminance", min: FAINTEST, max: BRIGHTEST, step: 0.01 });
    bright.addEventListener("input", () => {
      this.onChange(
        chosen,
        (key, judged) => withLuminance(key, judged, 10 ** bright.valueAsNumber),
        `luminance ${chosen}`,
      );
    });
    bright.addEventListener("change", () => this.onSettled());
    const said = tag("output");
    said.id = "key-luminance-said";
    const brightness = labelled("Luminance", bright);
    brightness.append(said);
    const parts = [head, labelled("Time in s", time), labelled("Colour", colour), brightness];
    if (answer.places.length > 1) {
      const place = tag("select");
      place.id = "key-place";
      for (const each of answer.places) place.append(new Option(each.name, each.name));
      place.addEventListener("change", () => {
        this.onChange(chosen, (key) => ({ ...key, place: place.value }));
      });
      parts.push(labelled("Place", place));
    }
    box.replaceChildren(...parts);
  }
}
