// The picture: patches of the material in the light of the time that is shown, each with a white
// card in the same light, and the keys of that time as rings filled with what is wanted.

import { hexOf, luminance, scaled } from "./studio_colour.js";
import { $ } from "./studio_words.js";

/** Luminance of a screen that automatic exposure gives the brightest patch. */
const EXPOSED = 0.45;
const CARD = 0.16;
const RING = 0.11;

/** Factor from colours to those of the screen, at a frame. */
export function exposureAt(answer, frame, chosenEv) {
  if (chosenEv !== null) return 2 ** chosenEv;
  const brightest = Math.max(...answer.places.map((place) => luminance(place.rgb[frame])));
  return brightest > 0 ? EXPOSED / brightest : 1;
}

function tiles(canvas, count) {
  const shape = canvas.width / canvas.height;
  const columns = Math.min(count, Math.ceil(Math.sqrt(count * shape)));
  const rows = Math.ceil(count / columns);
  const [width, height] = [canvas.width / columns, canvas.height / rows];
  const gap = Math.min(width, height) * 0.06;
  return Array.from({ length: count }, (_, i) => ({
    x: (i % columns) * width + gap,
    y: Math.floor(i / columns) * height + gap,
    width: width - 2 * gap,
    height: height - 2 * gap,
  }));
}

/** Place at a point of the canvas, given as parts of its width and height; -1 between patches. */
export function placeAt(answer, u, v) {
  const canvas = $("picture");
  const [x, y] = [u * canvas.width, v * canvas.height];
  return tiles(canvas, answer.places.length).findIndex(
    (tile) => x >= tile.x && x < tile.x + tile.width && y >= tile.y && y < tile.y + tile.height,
  );
}

/** Draws what is seen at a frame. `near` are the numbers of the keys that belong to it. */
export function drawPatches({ answer, frame, exposure, keys, near, chosen, chosenPlace }) {
  const canvas = $("picture");
  const pen = canvas.getContext("2d");
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--ink");
  pen.fillStyle = "#000";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.textBaseline = "top";
  tiles(canvas, answer.places.length).forEach((tile, number) => {
    const place = answer.places[number];
    pen.fillStyle = hexOf(scaled(place.rgb[frame], exposure));
    pen.fillRect(tile.x, tile.y, tile.width, tile.height);
    const card = Math.min(tile.width, tile.height) * CARD;
    pen.fillStyle = hexOf(scaled(place.card[frame], exposure));
    pen.fillRect(tile.x + tile.width - 1.35 * card, tile.y + 0.35 * card, card, card);
    pen.strokeStyle = "rgb(128 128 128 / 0.5)";
    pen.lineWidth = 1;
    pen.strokeRect(tile.x + tile.width - 1.35 * card, tile.y + 0.35 * card, card, card);
    if (answer.places.length > 1) {
      pen.strokeStyle = number === chosenPlace ? ink : "rgb(128 128 128 / 0.4)";
      pen.lineWidth = number === chosenPlace ? 3 : 1;
      pen.strokeRect(tile.x, tile.y, tile.width, tile.height);
      pen.font = "26px system-ui, sans-serif";
      pen.fillStyle = "rgb(0 0 0 / 0.6)";
      pen.fillRect(tile.x, tile.y, pen.measureText(place.name).width + 20, 38);
      pen.fillStyle = ink;
      pen.fillText(place.name, tile.x + 10, tile.y + 6);
    }
    const own = near.filter((i) => answer.keys[i]?.place === number);
    own.forEach((i, order) => {
      const radius = RING * Math.min(tile.width, tile.height);
      const x = tile.x + (tile.width * (order + 1)) / (own.length + 1);
      const y = tile.y + tile.height / 2;
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.fillStyle = hexOf(scaled(answer.keys[i].wanted, exposure));
      pen.fill();
      pen.lineWidth = i === chosen ? 5 : 2;
      pen.strokeStyle = i === chosen ? "#fff" : "rgb(255 255 255 / 0.6)";
      pen.stroke();
      pen.font = "600 24px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.fillStyle = "#fff";
      pen.fillText(String(i + 1), x, y + radius + 8);
      pen.textAlign = "left";
    });
  });
}
