// The live picture, what it says about light and focus, and writing regions to the protocol.

import { Regions, rounded } from "./view_regions.js";

const PERIOD_MS = 100;
const RETRY_MS = 1000;
const CLIP_COLOUR = [255, 47, 208, 255];
const STRIPE = 9;
const CHANNELS = ["R", "G", "B"];
// More of the picture than this at the end of the scale is worth a colour.
const MUCH_CLIPPED = 0.001;

const byId = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const picture = byId("picture");
const paint = picture.getContext("2d", { willReadFrequently: true });

let protocol = null;
let saved = "";
let clippedFrom = 250;
let frame = 0;

// Focus

class FocusBar {
  constructor(element) {
    this.element = element;
    this.best = 0;
  }

  show(value) {
    this.best = Math.max(this.best, value);
    const full = this.best * 1.15 || 1;
    const percent = this.best ? Math.round((100 * value) / this.best) : 0;
    this.element.querySelector(".fill").style.width = `${(100 * value) / full}%`;
    this.element.querySelector(".peak").style.left = `${(100 * this.best) / full}%`;
    this.element.querySelector("output").textContent = this.best ? `${percent} % of best` : "–";
    this.element.classList.toggle("best", percent >= 97);
  }
}

const wholeFocus = new FocusBar(byId("focus-whole"));
const regionFocus = new FocusBar(byId("focus-region"));
let measured = null;

byId("reset").addEventListener("click", () => {
  wholeFocus.best = 0;
  regionFocus.best = 0;
});

// Regions

const regions = new Regions(byId("stage"), byId("regions"), byId("list"), () => {
  const patches = regions.patches;
  const now = JSON.stringify(patches);
  const problem = regions.problem;
  byId("empty").hidden = patches.length > 0;
  byId("yaml").textContent = asYaml(patches);
  byId("write").disabled = problem !== null || patches.length === 0 || now === saved;
  if (protocol) {
    const clean = now === saved;
    say(problem ?? (clean ? "" : "Not written yet."), problem ? "failed" : "");
  }
  const chosen = regions.chosen;
  // Another region, or the same one elsewhere, has another best.
  const where = chosen && JSON.stringify(chosen.region);
  if (where !== measured) {
    measured = where;
    regionFocus.best = 0;
  }
  byId("focus-region").hidden = !chosen;
  byId("focus-region").querySelector(".name").textContent = chosen ? chosen.name || "Region" : "";
});

function asYaml(patches) {
  const name = (text) => (/^[A-Za-z][\w-]*$/.test(text) ? text : JSON.stringify(text));
  const lines = patches.map((patch) => `  ${name(patch.name)}: [${patch.region.join(", ")}]`);
  return ["patches:", ...lines].join("\n");
}

function say(text, kind) {
  byId("written").textContent = text;
  byId("written").className = kind;
}

byId("add").addEventListener("click", () => regions.add());
byId("write").addEventListener("click", async () => {
  const patches = regions.patches;
  try {
    const answer = await fetch("patches", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ patches }),
    });
    const told = await answer.json();
    if (!answer.ok) throw new Error(told.error);
    saved = JSON.stringify(patches);
    byId("write").disabled = JSON.stringify(regions.patches) === saved;
    byId("pixels").hidden = true;
    say(`Written to ${protocol} at ${new Date().toLocaleTimeString()}.`, "done");
  } catch (error) {
    say(`Not written: ${error.message}`, "failed");
  }
});

async function loadRegions() {
  const told = await (await fetch("patches")).json();
  protocol = told.protocol;
  byId("rig").textContent = told.rig;
  document.title = `${told.rig} – live view`;
  byId("write-box").hidden = !protocol;
  byId("write").textContent = `Write to ${protocol}`;
  byId("pixels").hidden = told.in_pixels.length === 0;
  byId("pixels").textContent =
    `${told.in_pixels.join(", ")}: given in pixels of the photograph, so not shown here. ` +
    "Writing replaces all regions of the file.";
  saved = JSON.stringify(
    told.patches.map(({ name, region }) => ({ name, region: region.map(rounded) })),
  );
  regions.load(told.patches);
}

// Light

function drawHistogram(histogram) {
  const canvas = byId("histogram");
  const to = canvas.getContext("2d");
  const { width, height } = canvas;
  to.globalCompositeOperation = "source-over";
  to.clearRect(0, 0, width, height);
  to.globalCompositeOperation = "lighter";
  // Square root, so that a small bright region is seen beside a large dark cloth.
  const most = Math.sqrt(Math.max(...histogram.flat(), 1e-6));
  histogram.forEach((channel, index) => {
    to.beginPath();
    to.moveTo(0, height);
    channel.forEach((fraction, bin) => {
      const y = height - (Math.sqrt(fraction) / most) * (height - 6);
      to.lineTo((bin / channel.length) * width, y);
      to.lineTo(((bin + 1) / channel.length) * width, y);
    });
    to.lineTo(width, height);
    to.fillStyle = css(["--r", "--g", "--b"][index]);
    to.globalAlpha = 0.6;
    to.fill();
  });
  to.globalAlpha = 1;
}

function showClipped(fractions, inRegion, region) {
  const parts = fractions.map((fraction, index) => {
    const part = document.createElement("span");
    part.className = CHANNELS[index] + (fraction > MUCH_CLIPPED ? " much" : "");
    part.append(document.createElement("i"), `${CHANNELS[index]} ${(100 * fraction).toFixed(1)} %`);
    return part;
  });
  if (inRegion !== null) {
    const part = document.createElement("span");
    part.className = inRegion > MUCH_CLIPPED ? "much" : "";
    part.textContent = `in ${region} ${(100 * inRegion).toFixed(1)} %`;
    parts.push(part);
  }
  byId("clipped").replaceChildren("Clipped", ...parts);
}

function markClipped() {
  const image = paint.getImageData(0, 0, picture.width, picture.height);
  const { data, width } = image;
  let found = false;
  for (let at = 0; at < data.length; at += 4) {
    if (data[at] >= clippedFrom || data[at + 1] >= clippedFrom || data[at + 2] >= clippedFrom) {
      // Stripes, so that what lies beneath is still seen to be aimed at.
      const pixel = at / 4;
      const striped = ((pixel % width) + Math.floor(pixel / width)) % STRIPE < STRIPE / 3;
      if (striped) data.set(CLIP_COLOUR, at);
      found = true;
    }
  }
  if (found) paint.putImageData(image, 0, 0);
}

// The picture

async function nextPicture() {
  const answer = await fetch(`frame.jpg?after=${frame}`);
  if (!answer.ok) throw new Error((await answer.json()).error);
  frame = Number(answer.headers.get("X-Picture"));
  const bitmap = await createImageBitmap(await answer.blob());
  if (picture.width !== bitmap.width || picture.height !== bitmap.height) {
    picture.width = bitmap.width;
    picture.height = bitmap.height;
    byId("stage").style.setProperty("--shape", bitmap.width / bitmap.height);
  }
  paint.drawImage(bitmap, 0, 0);
  bitmap.close();
  if (byId("mark").checked) markClipped();
  regions.setPixels(picture.width, picture.height);
}

async function nextStats() {
  const chosen = regions.chosen;
  const asked = chosen && JSON.stringify(chosen.region);
  const query = chosen ? `?region=${chosen.region.map(rounded).join(",")}` : "";
  const answer = await fetch(`stats${query}`);
  if (!answer.ok) return; // a region that is just being drawn may be too small to measure
  const stats = await answer.json();
  clippedFrom = stats.clipped_from;
  drawHistogram(stats.histogram);
  showClipped(stats.clipped, stats.region_clipped, chosen?.name || "region");
  wholeFocus.show(stats.focus);
  if (stats.region_focus !== null && asked === measured) regionFocus.show(stats.region_focus);
}

function tell(text, lost) {
  byId("status").textContent = text;
  byId("status").classList.toggle("lost", lost);
  byId("stage").classList.toggle("lost", lost);
}

async function watch() {
  let mean = PERIOD_MS;
  for (;;) {
    const began = performance.now();
    try {
      await nextPicture();
      await nextStats();
      mean += 0.2 * (Math.max(performance.now() - began, PERIOD_MS) - mean);
      const rate = 1000 / mean;
      const text = rate >= 1.5 ? rate.toFixed(0) : rate.toFixed(1);
      tell(`Live, ${picture.width} × ${picture.height} px, ${text} a second`, false);
    } catch (error) {
      // fetch says TypeError when nobody answers at all
      const gone = error instanceof TypeError;
      tell(gone ? "labrig has ended; start `labrig rig view` again." : error.message, true);
      await sleep(RETRY_MS);
    }
    // Nobody looks at a hidden page: the camera may rest.
    while (document.hidden) await sleep(PERIOD_MS);
    await sleep(Math.max(0, PERIOD_MS - (performance.now() - began)));
  }
}

await loadRegions();
await watch();
