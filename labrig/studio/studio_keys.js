// Keys as a file has them: a colour of a screen, and by how much brighter or fainter it is.

import { hexOf, linearOf, luminance, scaled, shown } from "./studio_colour.js";
import { short } from "./studio_words.js";

/** A key's colour and brightness, for a colour that the screen shows at an exposure. */
export function keyColour(rgb, exposure) {
  const bright = scaled(rgb, exposure);
  const most = Math.max(1, ...bright);
  const hex = hexOf(scaled(bright, 1 / most));
  return { colour: hex, brightness: Number((most / exposure).toPrecision(4)) };
}

/** What a key wants, for its swatch: the colour of its file, or of what the server made of it. */
export function swatch(key, judged) {
  if (typeof key.colour === "string") return key.colour;
  return judged ? shown(judged.wanted) : "#000000";
}

/** Luminance that a key wants, as a part of white. */
export function wantedLuminance(key, judged) {
  if (typeof key.colour === "string") return luminance(linearOf(key.colour)) * (key.brightness ?? 1);
  return judged ? luminance(judged.wanted) : 0;
}

export const ofWhite = (y) => (y > 0 ? `${short(y, 3)} of white` : "black");

/** Gives a key another luminance and keeps its colour, however that is given. */
export function withLuminance(key, judged, y) {
  const now = wantedLuminance(key, judged);
  if (now > 0) return { ...key, brightness: Number((((key.brightness ?? 1) * y) / now).toPrecision(4)) };
  // Black has no colour to keep.
  const { xyz, spectrum, ...rest } = key;
  return { ...rest, colour: "#ffffff", brightness: Number(y.toPrecision(4)) };
}

/** Gives a key another colour, as bright as the one before, or as what is there instead of black. */
export function withColour(key, judged, hex) {
  const y = wantedLuminance(key, judged) || (judged?.luminance[1] ?? 0) || luminance(linearOf(hex));
  const { xyz, spectrum, ...rest } = key;
  const own = luminance(linearOf(hex));
  return { ...rest, colour: hex, brightness: own > 0 ? Number((y / own).toPrecision(4)) : 1 };
}

/** What comes of all keys, in a sentence. */
export const summary = (keys) => {
  if (!keys.length) return "";
  const worst = keys.reduce((most, key, i) => (key.delta_e > keys[most].delta_e ? i : most), 0);
  const most = keys[worst].delta_e;
  if (most <= 1) return `${keys.length === 1 ? "The key is" : `All ${keys.length} keys are`} met, ΔE2000 ${short(most, 2)} at most.`;
  return `The largest difference is ΔE2000 ${short(most, 2)}, at key ${worst + 1}.`;
};
