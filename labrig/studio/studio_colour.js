// Colours: linear R, G, B, in which a white card under daylight of strength 1 is 1, 1, 1, and
// those of a screen (IEC 61966-2-1).

const ENCODED_END = 0.0031308;
const DECODED_END = 0.04045;

export const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
const encoded = (x) => (x <= ENCODED_END ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
const decoded = (x) => (x <= DECODED_END ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
const clamped = (x) => Math.min(1, Math.max(0, x));

/** Colour of a screen such as #20c060. */
export function hexOf(rgb) {
  const part = (x) => Math.round(255 * encoded(clamped(x))).toString(16).padStart(2, "0");
  return `#${rgb.map(part).join("")}`;
}

export function linearOf(hex) {
  return [1, 3, 5].map((i) => decoded(Number.parseInt(hex.slice(i, i + 2), 16) / 255));
}

export const scaled = (rgb, factor) => rgb.map((x) => x * factor);

/** Factor by which a screen shows a colour well; it may not exceed what the screen can show. */
function exposureOf(rgb, y) {
  const bright = scaled(rgb, y / luminance(rgb));
  return y / luminance(rgb) / Math.max(1, ...bright);
}

/** The colour as bright as a screen shows it well, its own brightness taken away. */
export function shown(rgb, y = 0.45) {
  return besides(rgb, rgb, y);
}

/** Another colour, exposed as `shown` exposes the first. */
export function besides(rgb, other, y = 0.45) {
  if (!(luminance(rgb) > 0)) return hexOf(other);
  return hexOf(scaled(other, exposureOf(rgb, y)));
}
