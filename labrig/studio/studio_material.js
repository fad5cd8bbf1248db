// The material: what is searched for, and its parameters as sliders with units.

import { shown } from "./studio_colour.js";
import { $, duration, field, short, tag } from "./studio_words.js";

/** Powers of ten from which to which a slider goes; its left end is 0 where that is possible. */
const RANGES = { k_r: [-6, 3], k_e: [-8, 3], reradiation: [-9, 3] };
const FEW_BANDS = 3;

/** σ of 1/x. */
const inverse = (sigma, x) => (sigma ? sigma / x ** 2 : undefined);

function slider({ name, value, sigma, isOpen, unit, range, mayBeZero, onInput, onSettled, words }) {
  const row = tag("div", undefined, isOpen ? "parameter open" : "parameter");
  const head = tag("label");
  const input = field("range", {
    min: range ? range[0] : 0,
    max: range ? range[1] : 1,
    step: range ? 0.005 : 0.001,
    "aria-label": name,
  });
  const said = tag("output");
  const show = (now) => {
    said.textContent = words ? words(now, sigma) : `${short(now)}${sigma ? ` ± ${short(sigma, 1)}` : ""} ${unit}`.trim();
  };
  input.value = String(range ? (value > 0 ? Math.log10(value) : range[0]) : value);
  show(value);
  input.addEventListener("input", () => {
    const at = input.valueAsNumber;
    const now = range ? (mayBeZero && at <= range[0] ? 0 : 10 ** at) : at;
    sigma = undefined;
    show(now);
    onInput(now);
  });
  input.addEventListener("change", onSettled);
  head.append(tag("span", name), said);
  if (isOpen) row.title = "The keys leave it open: other values would do as well.";
  row.append(head, input);
  return row;
}

export class Material {
  constructor({ onWish, onByHand, onSolve, onSettled, byHandNow }) {
    Object.assign(this, { onByHand, onSettled, byHandNow });
    $("states").addEventListener("change", (event) => onWish({ states: Number(event.target.value) }));
    $("order").addEventListener("change", (event) => {
      onWish({ order: event.target.value === "free" ? "free" : 1 });
    });
    $("albedo").addEventListener("change", (event) => {
      const given = event.target.value === "" ? "free" : event.target.valueAsNumber / 100;
      if (given === "free" || (given >= 0 && given <= 1)) onWish({ albedo: given });
    });
    $("bands").addEventListener("change", (event) => {
      const bands = event.target.value;
      const edges = (first, last, step) => Array.from({ length: (last - first) / step + 1 }, (_, i) => first + step * i);
      onWish({ bands_nm: bands === "three" ? undefined : edges(360, 720, Number(bands)) });
    });
    $("solve").addEventListener("click", onSolve);
  }

  draw({ answer, wish, byHand, isRenderedAgain }) {
    $("states").value = String(wish.states ?? 1);
    $("order").value = wish.order === "free" ? "free" : "1";
    const albedo = wish.albedo ?? "free";
    if (document.activeElement !== $("albedo")) {
      $("albedo").value = typeof albedo === "number" ? String(100 * albedo) : "";
    }
    $("albedo").placeholder = Array.isArray(albedo) ? "by bands" : "free";
    const width = wish.bands_nm ? wish.bands_nm[1] - wish.bands_nm[0] : 0;
    const choice = wish.bands_nm ? String(width) : "three";
    $("bands").value = [...$("bands").options].some((each) => each.value === choice) ? choice : "";
    $("by-hand").hidden = !byHand;
    $("by-hand-said").textContent = isRenderedAgain ? "As rendered in its own light." : "Set by hand.";
    $("solve").disabled = !wish.keys.length;
    if (this.isHeld()) return;
    const { parameters } = answer;
    const parts = parameters.k_r_per_s.map((_, state) => this.#state(answer, state));
    parts.push(this.#albedo(answer));
    // Another set of sliders: who moves one by keys goes on.
    const sliders = () => [...document.querySelectorAll("#parameters input")];
    const focused = sliders().indexOf(document.activeElement);
    $("parameters").replaceChildren(...parts);
    sliders()[focused]?.focus();
    // Of materials that are spread those of the dots follow from their keys alone.
    for (const input of document.querySelectorAll("#parameters input")) {
      input.disabled = Boolean(wish.scene?.spread && wish.keys.length);
    }
  }

  /** Whether a slider is being dragged, which must not be replaced. */
  isHeld() {
    return document.querySelector("#parameters input:active") !== null;
  }

  #state(answer, state) {
    const { parameters } = answer;
    const several = parameters.k_r_per_s.length > 1;
    const label = several ? ` ${state + 1}` : "";
    const box = tag("fieldset");
    const legend = tag("legend", several ? `State ${state + 1}` : "Glow");
    const dot = tag("i", undefined, "swatch");
    const rgb = answer.bands.length === 3 ? parameters.reradiation[state] : null;
    if (rgb) {
      dot.style.background = shown(rgb);
      legend.append(dot);
    }
    box.append(legend);
    const isFirst = parameters.order === 1;
    box.append(
      this.#slider(answer, {
        name: isFirst ? "Lifetime 1/k_r" : "Rate k_r",
        of: `k_r${label}`,
        value: parameters.k_r_per_s[state],
        unit: "s⁻¹",
        range: isFirst ? RANGES.k_r.map((x) => -x).reverse() : RANGES.k_r,
        inverted: isFirst,
        put: (made, now) => { made.k_r_per_s[state] = now; },
      }),
    );
    this.#bands(box, answer, "Re-radiation Λ", (band) => ({
      name: `Λ ${answer.bands[band]}`,
      of: `Λ${label} ${answer.bands[band]}`,
      value: parameters.reradiation[state][band],
      unit: "s sr⁻¹",
      range: RANGES.reradiation,
      mayBeZero: true,
      put: (made, now) => { made.reradiation[state][band] = now; },
    }));
    this.#bands(box, answer, "Excitation k_e", (band) => ({
      name: `k_e ${answer.bands[band]}`,
      of: `k_e${label} ${answer.bands[band]}`,
      value: parameters.k_e_per_s[state][band],
      unit: "s⁻¹ per light of 1",
      range: RANGES.k_e,
      mayBeZero: true,
      put: (made, now) => { made.k_e_per_s[state][band] = now; },
    }));
    return box;
  }

  #albedo(answer) {
    const box = tag("fieldset");
    box.append(tag("legend", "Albedo"));
    this.#bands(box, answer, "Albedo", (band) => ({
      name: answer.bands[band],
      of: `albedo ${answer.bands[band]}`,
      value: answer.parameters.albedo[band],
      words: (now) => `${Math.round(100 * now)} %`,
      put: (made, now) => { made.albedo[band] = now; },
    }));
    return box;
  }

  #bands(box, answer, title, of) {
    const sliders = answer.bands.map((_, band) => this.#slider(answer, of(band)));
    if (sliders.length <= FEW_BANDS) {
      box.append(...sliders);
      return;
    }
    const details = tag("details");
    details.append(tag("summary", `${title}, ${sliders.length} bands`), ...sliders);
    box.append(details);
  }

  #slider(answer, { inverted, put, of, value, ...rest }) {
    const turned = (x) => (inverted ? 1 / x : x);
    return slider({
      ...rest,
      value: turned(value),
      sigma: inverted ? inverse(answer.sigma[of], value) : answer.sigma[of],
      isOpen: answer.open.includes(of),
      words: inverted ? (now, sigma) => duration(now) + (sigma ? ` ± ${short(sigma, 1)} s` : "") : rest.words,
      onInput: (now) => {
        const made = this.byHandNow() ?? JSON.parse(JSON.stringify(answer.parameters));
        put(made, turned(now));
        this.onByHand(made, of);
      },
      onSettled: () => this.onSettled(),
    });
  }
}
