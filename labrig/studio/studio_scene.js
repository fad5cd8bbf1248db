// The picture of a scene, rendered by labrig: one picture is on its way at most, and the last one
// that was asked for is shown. Keys are dots where they were set.

import { hexOf, scaled } from "./studio_colour.js";
import { $ } from "./studio_words.js";

/** Radius of a dot, and the distance at which it is met, as parts of the picture's height. */
const [DOT, MEET] = [0.022, 0.04];

export class ScenePicture {
  #isAsking = false;
  #wanted = null;
  #image = null;

  constructor(post, onShown) {
    this.post = post;
    this.onShown = onShown;
    /** Factor from colours to those of the screen of the picture that is shown. */
    this.exposure = 1;
  }

  /** Asks for the picture of a time; `ev` is null where exposure follows the glow. */
  async ask(state, t_s, ev) {
    this.#wanted = { ...state, t_s, exposure_ev: ev };
    if (this.#isAsking) return;
    this.#isAsking = true;
    document.body.dataset.painting = "yes";
    while (this.#wanted) {
      const question = this.#wanted;
      this.#wanted = null;
      const start = performance.now();
      try {
        const reply = await this.post("scene.png", question);
        this.exposure = Number(reply.headers.get("X-Exposure"));
        const next = await createImageBitmap(await reply.blob());
        this.#image?.close();
        this.#image = next;
        this.onShown();
        performance.measure("picture", { start, end: performance.now() });
      } catch {
        // What is wrong is said where the same question is answered in numbers.
      }
    }
    this.#isAsking = false;
    delete document.body.dataset.painting;
  }

  draw({ answer, keys, pixels, near, chosen, chosenPlace, cross }) {
    const canvas = $("picture");
    const { width_px, height_px } = answer.scene;
    const height = Math.round((canvas.width * height_px) / width_px);
    if (canvas.height !== height) canvas.height = height;
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#000";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.imageSmoothingQuality = "high";
    if (this.#image) pen.drawImage(this.#image, 0, 0, canvas.width, canvas.height);
    const radius = DOT * canvas.height;
    for (const [name, [u, v]] of Object.entries(pixels)) {
      const place = answer.places.findIndex((each) => each.name === name);
      const now = near.find((i) => answer.keys[i]?.place === place);
      const [x, y] = [u * canvas.width, v * canvas.height];
      pen.beginPath();
      pen.arc(x, y, now === undefined ? radius * 0.6 : radius, 0, 2 * Math.PI);
      if (now !== undefined) {
        pen.fillStyle = hexOf(scaled(answer.keys[now].wanted, this.exposure));
        pen.fill();
      }
      pen.lineWidth = place === chosenPlace ? 5 : 2.5;
      pen.strokeStyle = "rgb(0 0 0 / 0.6)";
      pen.stroke();
      pen.lineWidth -= 2;
      pen.strokeStyle = now !== undefined && now === chosen ? "#fff" : "rgb(255 255 255 / 0.75)";
      pen.stroke();
      const numbers = keys.flatMap((_, i) => (answer.keys[i]?.place === place ? [i + 1] : []));
      pen.font = `600 ${Math.round(radius * 1.3)}px system-ui, sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "top";
      pen.lineWidth = 4;
      pen.strokeStyle = "rgb(0 0 0 / 0.7)";
      pen.strokeText(numbers.join(" "), x, y + radius + 4);
      pen.fillStyle = "#fff";
      pen.fillText(numbers.join(" "), x, y + radius + 4);
      pen.textAlign = "left";
    }
    if (cross) {
      const [x, y] = [cross[0] * canvas.width, cross[1] * canvas.height];
      pen.lineWidth = 2;
      pen.strokeStyle = "#fff";
      pen.strokeRect(x - radius / 2, y - radius / 2, radius, radius);
    }
  }
}

/** Name of the dot at a point of the picture, given as parts of its width and height. */
export function dotAt(answer, pixels, u, v) {
  const shape = answer.scene.width_px / answer.scene.height_px;
  return Object.keys(pixels).find(
    (name) => Math.hypot((pixels[name][0] - u) * shape, pixels[name][1] - v) < MEET,
  );
}

/** A name for another dot. */
export function newDot(pixels) {
  let number = Object.keys(pixels).length + 1;
  while (`dot ${number}` in pixels) number += 1;
  return `dot ${number}`;
}
