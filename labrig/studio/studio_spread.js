// A material of its own for each dot: how far it reaches, and what is painted to have it.

import { $, short, whileDragged } from "./studio_words.js";

/** Distances in texels and differences of colours where a wish says nothing. */
const DEFAULTS = { position: 20, appearance: 0.1, brush: 2 };
/** Distance between the points of a stroke, as a part of its radius. */
const SPACING = 0.5;
const COLOURS = ["#ffb454", "#59c2ff", "#c2d94c", "#f07178", "#d2a6ff", "#95e6cb"];

export class Spread {
  constructor({ onSpread, onStroke, onSettled }) {
    Object.assign(this, { onStroke, onSettled });
    $("spread").addEventListener("change", (event) => {
      onSpread(() => (event.target.value === "own" ? {} : undefined));
    });
    for (const name of Object.keys(DEFAULTS)) {
      const slider = $(`spread-${name}`);
      slider.addEventListener("input", () => {
        const value = Number((10 ** slider.valueAsNumber).toPrecision(3));
        onSpread((spread) => ({ ...spread, [name]: value }), `spread ${name}`);
      });
      slider.addEventListener("change", onSettled);
    }
    $("paint").addEventListener("click", () => {
      $("paint").setAttribute("aria-pressed", String(!this.isPainting));
    });
    $("unpaint").addEventListener("click", () => onSpread(({ strokes, ...rest }) => rest));
  }

  /** Whether dragging on the picture paints. */
  get isPainting() {
    return $("paint").getAttribute("aria-pressed") === "true";
  }

  draw({ answer, wish }) {
    const spread = wish.scene?.spread;
    $("spread-choice").hidden = !answer.scene;
    for (const id of ["spread-tools", "paint-tools"]) $(id).hidden = !spread;
    $("spread").value = spread ? "own" : "one";
    // Rates that differ from texel to texel are of order 1.
    $("order").disabled = Boolean(spread);
    if (!spread) return;
    for (const [name, usual] of Object.entries(DEFAULTS)) {
      const value = spread[name] ?? usual;
      const slider = $(`spread-${name}`);
      if (!slider.matches(":active")) slider.value = String(Math.log10(value));
      $(`spread-${name}-said`).textContent = name === "appearance" ? short(value, 2) : `${short(value, 2)} texels`;
    }
    // Without a picture of the surface its texels look alike.
    $("spread-by-appearance").hidden = !spread.appearance_file;
    $("unpaint").disabled = !Object.keys(spread.strokes ?? {}).length;
    $("paint").disabled = !Object.keys(wish.pixels).length;
  }

  /** Whether a press on the picture begins a stroke. */
  begins(event, wish) {
    return Boolean(wish.scene?.spread) && Object.keys(wish.pixels).length > 0 && (this.isPainting || event.shiftKey);
  }

  /** Paints for the nearest dot until the pointer is let go. */
  stroke(first, pointOf, answer, pixels) {
    const shape = answer.scene.width_px / answer.scene.height_px;
    const apart = (a, b) => Math.hypot((a[0] - b[0]) * shape, a[1] - b[1]);
    const dot = Object.keys(pixels).sort((a, b) => apart(pixels[a], first) - apart(pixels[b], first))[0];
    const radius = $("spread-width").valueAsNumber;
    let last = null;
    const paint = (point) => {
      const steps = last ? Math.floor(apart(point, last) / (SPACING * radius)) : 1;
      if (steps < 1) return;
      // A fast pointer skips what lies between.
      const from = last ?? point;
      const points = Array.from({ length: steps }, (_, i) => from.map((x, axis) => x + ((i + 1) / steps) * (point[axis] - x)));
      last = point;
      const within = (x) => Number(Math.min(Math.max(x, 0), 1).toFixed(4));
      this.onStroke(dot, points.map((each) => [...each.map(within), radius]));
    };
    paint(first);
    whileDragged((event) => paint(pointOf(event)), () => this.onSettled());
  }

  /** Draws what was painted over the picture, while somebody paints. */
  drawStrokes(canvas, wish) {
    const strokes = wish.scene?.spread?.strokes;
    if (!strokes || !this.isPainting) return;
    const pen = canvas.getContext("2d");
    const dots = Object.keys(wish.pixels);
    pen.save();
    for (const [dot, points] of Object.entries(strokes)) {
      pen.strokeStyle = COLOURS[dots.indexOf(dot) % COLOURS.length];
      pen.lineWidth = 1.5;
      pen.globalAlpha = 0.7;
      for (const [x, y, radius] of points) {
        pen.beginPath();
        pen.arc(x * canvas.width, y * canvas.height, radius * canvas.height, 0, 2 * Math.PI);
        pen.stroke();
      }
    }
    pen.restore();
  }
}

/** The wish with another `spread`; `undefined` is one material for all. */
export function withSpread(wish, change) {
  const { spread, ...scene } = wish.scene;
  const next = change(spread ?? {});
  const { order, ...rest } = wish;
  return next ? { ...rest, scene: { ...scene, spread: next } } : { ...wish, scene };
}

/** What the page shows of the material at a place: its own, or that of all. */
export function answerAt(answer, place) {
  return { ...answer, ...answer.places[place].material };
}
