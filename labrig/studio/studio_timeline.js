// The time line: every light has a stretch of its own, within which time runs the slower the
// shorter it has been on. Above it stands how bright each place is, in its colour, and the keys.

import { luminance, shown } from "./studio_colour.js";
import { changesOf } from "./studio_light.js";
import { swatch, wantedLuminance } from "./studio_keys.js";
import { $, duration, powerOfTen, svg, whileDragged } from "./studio_words.js";

const [WIDTH, HEIGHT, TRACK, LEFT, RIGHT, TOP] = [1000, 240, 34, 50, 10, 8];
const FLOOR = HEIGHT - TRACK - 26;
const DECADES = 7;
const RADIUS = 9;
/** Width from which a light's name stands in it. */
const NAMED = 60;

/** Frame, with a part, of a time. */
export function frameOf(frames_s, t_s) {
  const after = frames_s.findIndex((each) => each >= t_s);
  if (after < 0) return frames_s.length - 1;
  if (after === 0) return 0;
  return after - 1 + (t_s - frames_s[after - 1]) / (frames_s[after] - frames_s[after - 1]);
}

export function timeOf(frames_s, frame) {
  const at = Math.min(Math.max(frame, 0), frames_s.length - 1);
  const before = Math.floor(at);
  const after = Math.min(before + 1, frames_s.length - 1);
  return frames_s[before] + (at - before) * (frames_s[after] - frames_s[before]);
}

export class Timeline {
  #x;
  #y;
  #frames_s = [];
  #range = [1e-6, 1];

  constructor({ onFrame, onKey, onChosen, onLight, onSettled }) {
    this.svg = $("timeline");
    this.svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    this.svg.addEventListener("pointerdown", (event) => {
      const key = event.target.closest("[data-key]");
      const light = event.target.closest("[data-light]");
      if (light) onLight(Number(light.dataset.light));
      if (key) {
        onChosen(Number(key.dataset.key));
        const number = Number(key.dataset.key);
        this.#drag(event, (at) => onKey(number, at, `drag ${number}`), onSettled);
      } else this.#drag(event, ({ frame }) => onFrame(Math.round(frame)), () => {}, true);
    });
    this.svg.addEventListener("keydown", (event) => {
      const key = event.target.closest("[data-key]");
      const light = event.target.closest("[data-light]");
      if (light && (event.key === "Enter" || event.key === " ")) {
        event.preventDefault();
        onLight(Number(light.dataset.light));
      }
      if (!key) return;
      const number = Number(key.dataset.key);
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      const now = this.at[number];
      onKey(number, {
        t_s: timeOf(this.#frames_s, now.frame + by[0]),
        luminance: now.luminance * 1.1 ** by[1],
        isTime: by[0] !== 0,
        isLuminance: by[1] !== 0,
      });
    });
  }

  #drag(event, move, settled, fromStart = false) {
    event.preventDefault();
    const start = this.#point(event);
    let moved = false;
    const follow = (next) => {
      const at = this.#point(next);
      moved ||= Math.hypot(at.x - start.x, at.y - start.y) > 3;
      if (moved || fromStart) {
        move({
          frame: this.#frame(at.x),
          t_s: timeOf(this.#frames_s, this.#frame(at.x)),
          luminance: this.#luminance(at.y),
          isTime: Math.abs(at.x - start.x) > 3,
          isLuminance: Math.abs(at.y - start.y) > 3,
        });
      }
    };
    if (fromStart) follow(event);
    whileDragged(follow, settled);
  }

  #point(event) {
    const box = this.svg.getBoundingClientRect();
    return {
      x: ((event.clientX - box.left) / box.width) * WIDTH,
      y: ((event.clientY - box.top) / box.height) * HEIGHT,
    };
  }

  #frame(x) {
    return ((x - LEFT) / (WIDTH - LEFT - RIGHT)) * (this.#frames_s.length - 1);
  }

  #luminance(y) {
    const part = (FLOOR - y) / (FLOOR - TOP);
    return this.#range[0] * (this.#range[1] / this.#range[0]) ** part;
  }

  draw({ answer, wish, frame, chosen, chosenPlace, chosenLight }) {
    this.#frames_s = answer.frames_s;
    const n = answer.frames_s.length;
    this.#x = (at) => LEFT + (at / (n - 1)) * (WIDTH - LEFT - RIGHT);
    const bright = [
      ...answer.places.flatMap((place) => place.rgb.map(luminance)),
      ...wish.keys.map((key, i) => wantedLuminance(key, answer.keys[i])),
    ].filter((y) => y > 0);
    const top = Math.ceil(Math.log10(Math.max(...bright, 1e-6)) + 0.05);
    const bottom = Math.max(Math.floor(Math.log10(Math.min(...bright, 1))), top - DECADES);
    this.#range = [10 ** bottom, 10 ** top];
    this.#y = (y) => FLOOR - ((Math.log10(Math.max(y, 1e-30)) - bottom) / (top - bottom)) * (FLOOR - TOP);
    const parts = [];
    for (let power = bottom; power <= top; power += 1) {
      const y = this.#y(10 ** power);
      parts.push(svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }));
      parts.push(svg("text", { x: LEFT - 8, y: y + 4, "text-anchor": "end" }, power === 0 ? "white" : powerOfTen(power)));
    }
    parts.push(...this.#lights(answer, wish, chosenPlace, chosenLight));
    answer.places.forEach((place, number) => {
      parts.push(this.#curve(place, number === chosenPlace || answer.places.length === 1));
    });
    const now = this.#x(frame);
    parts.push(svg("line", { class: "now", x1: now, x2: now, y1: TOP, y2: HEIGHT }));
    this.at = wish.keys.map((key, i) => ({
      frame: frameOf(answer.frames_s, Number.parseFloat(key.at)),
      luminance: wantedLuminance(key, answer.keys[i]),
    }));
    wish.keys.forEach((key, i) => parts.push(this.#key(key, i, answer, chosen)));
    const focused = document.activeElement?.closest?.("#timeline [data-key], #timeline [data-light]");
    const again = focused && (focused.dataset.key !== undefined ? `[data-key="${focused.dataset.key}"]` : `[data-light="${focused.dataset.light}"]`);
    this.svg.replaceChildren(...parts);
    if (again) this.svg.querySelector(again)?.focus();
  }

  #curve(place, isChosen) {
    const group = svg("g", { class: isChosen ? "curve chosen" : "curve" });
    const point = (i) => {
      const y = Math.min(this.#y(luminance(place.rgb[i])), FLOOR);
      return `${this.#x(i).toFixed(1)},${y.toFixed(1)}`;
    };
    const colours = place.rgb.map((rgb) => shown(rgb, 0.3));
    // One line for each stretch of one colour.
    for (let from = 0; from < colours.length - 1; ) {
      let to = from + 1;
      while (to < colours.length - 1 && colours[to + 1] === colours[to]) to += 1;
      const points = Array.from({ length: to - from + 1 }, (_, k) => point(from + k)).join(" ");
      const isVisible = place.rgb.slice(from, to + 1).some((rgb) => luminance(rgb) > this.#range[0]);
      if (isVisible) group.append(svg("polyline", { points, stroke: colours[to] }));
      from = to;
    }
    return group;
  }

  #lights(answer, wish, chosenPlace, chosenLight) {
    const place = answer.places[chosenPlace];
    const changes = changesOf(wish, place.name);
    const y = HEIGHT - TRACK;
    return changes.map(({ at_s, isDark, label }, i) => {
      const frame = frameOf(answer.frames_s, at_s);
      const begin = this.#x(frame);
      const end = changes[i + 1] ? this.#x(frameOf(answer.frames_s, changes[i + 1].at_s)) : WIDTH - RIGHT;
      const lit = place.card[Math.min(Math.round(frame) + 1, answer.frames_s.length - 1)];
      const group = svg("g", {
        class: `light${i === chosenLight ? " chosen" : ""}`,
        "data-light": i,
        tabindex: 0,
        role: "button",
        "aria-label": `Light from ${duration(at_s)}: ${label}`,
      });
      group.append(
        svg("rect", { x: begin, y, width: Math.max(end - begin, 2), height: TRACK - 14, fill: isDark ? "#000" : shown(lit, 0.6), rx: 3 }),
        svg("text", { x: begin, y: HEIGHT - 2 }, duration(at_s)),
      );
      if (end - begin > NAMED) {
        group.append(svg("text", { class: isDark ? "name dark" : "name", x: begin + 8, y: y + 14 }, label));
      }
      return group;
    });
  }

  #key(key, i, answer, chosen) {
    const { frame, luminance: y } = this.at[i];
    const [x, height] = [this.#x(frame), Math.min(Math.max(this.#y(y), TOP + RADIUS), FLOOR)];
    const judged = answer.keys[i];
    const isMissed = judged && judged.delta_e > 2;
    const group = svg("g", {
      class: `key${i === chosen ? " chosen" : ""}${isMissed ? " missed" : ""}`,
      "data-key": i,
      tabindex: 0,
      role: "button",
      "aria-label": `Key ${i + 1} at ${key.at}, arrows move it`,
    });
    if (judged && isMissed && judged.luminance[1] > 0) {
      const got = Math.min(Math.max(this.#y(judged.luminance[1]), TOP), FLOOR);
      group.append(svg("line", { class: "miss", x1: x, x2: x, y1: height, y2: got }));
    }
    group.append(
      svg("circle", { class: "halo", cx: x, cy: height, r: RADIUS + 7 }),
      svg("circle", { cx: x, cy: height, r: RADIUS, fill: swatch(key, judged) }),
      svg("text", { x, y: height + RADIUS + 13, "text-anchor": "middle" }, String(i + 1)),
    );
    return group;
  }
}
