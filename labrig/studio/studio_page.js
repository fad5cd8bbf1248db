// Asks labrig for the material that meets the keys, and shows it: at most one question is on its
// way, and the last change is always answered.

import { luminance } from "./studio_colour.js";
import { History } from "./studio_history.js";
import { Keys } from "./studio_key_panel.js";
import { keyColour, summary, withLuminance } from "./studio_keys.js";
import { Light, changesOf } from "./studio_light.js";
import { Material } from "./studio_material.js";
import { drawPatches, exposureAt, placeAt } from "./studio_patches.js";
import { ScenePicture, dotAt, newDot } from "./studio_scene.js";
import { Spread, answerAt, withSpread } from "./studio_spread.js";
import { Timeline, frameOf, timeOf } from "./studio_timeline.js";
import { $, duration, seconds, tag, whileDragged, written } from "./studio_words.js";

const PLAY_MS = 50;
const DEFAULT_GREEN = [0.014, 0.527, 0.117];
/** Frames around a key at which its ring is shown. */
const NEAR = 1.5;
/** Wishes that cannot be met, and are written one by one. */
const MOST_LINES = 20;
/** Frames by which PageUp and PageDown go. */
const PAGE_FRAMES = 8;
/** Step of the cross that the keyboard moves over the picture of a scene. */
const CROSS_STEP = 0.02;

const view = { frame: 0, chosen: -1, chosenPlace: 0, chosenLight: 0, ev: null, asked: null, wasDragged: false, judged: null, cross: null };
let answer = null;
let history = null;
let isAsking = false;
let isStale = false;
let playing = 0;

async function post(path, content) {
  let reply;
  try {
    reply = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(content),
    });
  } catch {
    throw new Error("labrig does not answer; is it still running?");
  }
  if (reply.ok) return reply;
  throw new Error((await reply.json()).error);
}

function say(text) {
  $("message").hidden = !text;
  $("message").textContent = text ?? "";
}

/** What is designed; while a hand drags, an answer that is quick matters more than the last one. */
const question = () => ({ ...history.now, is_draft: history.isInGesture });

/** Is kept when the last change is answered. */
let answered = Promise.resolve();

function ask() {
  isStale = true;
  if (!isAsking) answered = askUntilAnswered();
}

async function askUntilAnswered() {
  isAsking = true;
  document.body.dataset.busy = "yes";
  while (isStale) {
    isStale = false;
    const begin = performance.now();
    try {
      const next = await (await post("look", question())).json();
      const isFirst = answer === null;
      const shownAt = answer && timeOf(answer.frames_s, view.frame);
      answer = next;
      // The frames of another programme are others: the time that is shown stays.
      if (shownAt !== null) view.frame = Math.round(frameOf(answer.frames_s, shownAt));
      if (isFirst) view.frame = Math.min(answer.first.at(-1) + 12, answer.frames_s.length - 1);
      say();
      delete document.body.dataset.refused;
      draw();
      performance.measure("answer", { start: begin, end: performance.now() });
      $("speed").textContent = `Answered in ${Math.round(performance.now() - begin)} ms.`;
    } catch (error) {
      say(error.message);
      if (answer === null) break;
      // What is shown belongs to the wish before.
      document.body.dataset.refused = "yes";
      $("status").textContent = "The last change is not answered: mend it, or undo it.";
    }
  }
  isAsking = false;
  delete document.body.dataset.busy;
}

function changed() {
  $("undo").disabled = !history.canUndo;
  $("redo").disabled = !history.canRedo;
  ask();
}

/** Changes the wish; what was set by hand is given up if `keepsHand` is not said. */
function wish(change, gesture = null, keepsHand = false) {
  const now = history.now;
  const next = change(now.wish) ?? now.wish;
  history.set({ wish: next, by_hand: keepsHand ? now.by_hand : null }, gesture);
}

function changeKey(number, change, gesture = null) {
  wish((now) => {
    now.keys[number] = change(now.keys[number], answer.keys[number]);
  }, gesture, true);
}

function near(keys) {
  return keys.flatMap((key, i) =>
    Math.abs(frameOf(answer.frames_s, seconds(key.at)) - view.frame) <= NEAR ? [i] : [],
  );
}

function draw() {
  const { wish: now, by_hand } = history.now;
  view.chosen = Math.min(view.chosen, now.keys.length - 1);
  view.chosenPlace = Math.min(view.chosenPlace, answer.places.length - 1);
  view.chosenLight = Math.min(view.chosenLight, changesOf(now, placeShown()).length - 1);
  view.frame = Math.min(view.frame, answer.frames_s.length - 1);
  const all = { answer, wish: now, ...view };
  const judged = JSON.stringify({ ...now, name: "" });
  if (judged !== view.judged) {
    view.judged = judged;
    $("nearest").replaceChildren();
    $("rendered-again").replaceChildren();
  }
  if (document.activeElement !== $("name")) $("name").value = now.name ?? "design";
  drawTime(all);
  timeline.draw(all);
  keys.draw(all);
  light.draw(all);
  material.draw({
    answer: answerAt(answer, view.chosenPlace),
    wish: now,
    byHand: by_hand,
    isRenderedAgain: answer.is_rendered_again,
  });
  spread.draw({ answer, wish: now });
  for (const id of ["add-place", "remove-place"]) $(id).hidden = Boolean(answer.scene);
  $("remove-place").disabled = answer.places.length < 2;
  $("again").hidden = !answer.scene;
  $("hint").textContent = answer.scene
    ? `Click on '${answer.scene.material}' to set a key: so it shall look there at this time. Drag a dot to move it.`
    : `Click on the ${answer.places.length > 1 ? "chosen patch" : "material"} to set a key: so it shall look at this time. The small square is a white card in the same light.`;
  $("impossible-section").hidden = !answer.impossible.length && !answer.conflicts.length && !answer.energy;
  const fights = answer.conflicts.map(([a, b]) => `Keys ${a + 1} and ${b + 1} work against each other.`);
  const wishes = answer.impossible.map((each) => each.text);
  const more = wishes.length > MOST_LINES ? [`${wishes.length - MOST_LINES} more wishes are not possible.`] : [];
  const energy = answer.energy ? [answer.energy] : [];
  $("impossible").replaceChildren(
    ...[...wishes.slice(0, MOST_LINES), ...more, ...energy, ...fights].map((text) => tag("li", begun(text))),
  );
  const result = summary(answer.keys);
  $("status").textContent = result || (by_hand ? "No keys yet: a glow that is set by hand." : "No keys yet: a plain green glow to look at.");
  $("save-material").disabled = false;
  $("save-picture").disabled = !now.keys.length;
  $("find-nearest").disabled = !now.keys.length;
}

/** The place that is chosen, of those that are answered for. */
const placeNumber = () => Math.min(view.chosenPlace, answer.places.length - 1);
const placeShown = () => answer.places[placeNumber()].name;

function exposure() {
  return answer.scene ? picture.exposure : exposureAt(answer, view.frame, view.ev);
}

function drawTime(all = { answer, wish: history.now.wish, ...view, chosenPlace: placeNumber() }) {
  const t_s = answer.frames_s[view.frame];
  const drawn = { ...all, keys: all.wish.keys, near: near(all.wish.keys), exposure: exposure() };
  if (answer.scene) {
    picture.draw({ ...drawn, pixels: all.wish.pixels });
    spread.drawStrokes($("picture"), all.wish);
    askPicture(t_s);
  } else drawPatches(drawn);
  const change = changesOf(all.wish, placeShown()).filter((each) => each.at_s <= t_s).at(-1);
  $("frame").max = answer.frames_s.length - 1;
  $("frame").value = view.frame;
  $("frame").setAttribute("aria-valuetext", duration(t_s));
  $("time-said").textContent = change ? `${duration(t_s)}: ${duration(t_s - change.at_s)} of ${change.label}` : duration(t_s);
  const stops = Math.log2(exposure());
  $("ev-said").textContent = `${stops >= 0 ? "+" : "−"}${Math.abs(stops).toFixed(1)} stops`;
  if (view.ev === null) $("ev").value = stops;
}

/** A time with few digits of the delay since the light last changed, which is what matters. */
function tidy(t_s) {
  const change = changesOf(history.now.wish, placeShown()).filter((each) => each.at_s <= t_s).at(-1);
  const since_s = change ? change.at_s : 0;
  return since_s + Number((t_s - since_s).toPrecision(3));
}

/** Asks for the picture of a scene, unless it is the one that was asked for last. */
function askPicture(t_s) {
  const asked = JSON.stringify([question(), t_s, view.ev]);
  if (asked === view.asked) return;
  view.asked = asked;
  picture.ask(question(), t_s, view.ev);
}

function show(frame) {
  view.frame = Math.min(Math.max(frame, 0), answer.frames_s.length - 1);
  const { wish: now } = history.now;
  drawTime();
  timeline.draw({ answer, wish: now, ...view, chosenPlace: placeNumber() });
}

function choose(number) {
  view.chosen = number;
  const judged = answer.keys[number];
  if (judged) {
    view.chosenPlace = judged.place;
    view.frame = Math.round(frameOf(answer.frames_s, judged.at_s));
  }
  draw();
}

/** Sets a key that wants what is there: a beginning, to be changed. */
function addKey(place) {
  const name = answer.places[place].name;
  if (answer.scene && !(name in history.now.wish.pixels)) {
    say("Click on the material in the picture: a key belongs to a place.");
    return;
  }
  const t_s = answer.frames_s[view.frame];
  const { keys: before } = history.now.wish;
  const same = before.findIndex((key) => (key.place ?? answer.places[0].name) === name && Math.abs(seconds(key.at) - t_s) < 1e-9);
  if (same >= 0) choose(same);
  else push(name, answer.places[place].rgb[view.frame]);
}

/** Adds a key of a colour, at a new dot of the picture if a point of it is given. */
function push(name, rgb, point = null, t_s = answer.frames_s[view.frame], factor = exposure()) {
  const isDark = !(luminance(rgb) > 0);
  const colour = keyColour(isDark ? DEFAULT_GREEN.map((x) => x / factor) : rgb, factor);
  view.chosen = history.now.wish.keys.length;
  wish((now) => {
    if (point) now.pixels[name] = point;
    view.chosenPlace = point ? Object.keys(now.pixels).indexOf(name) : answer.places.findIndex((each) => each.name === name);
    now.keys.push({ at: written(t_s), place: name, ...colour });
  });
}

/** Sets a key where somebody clicked. */
async function addKeyAt(u, v) {
  if (!answer.scene) {
    const place = placeAt(answer, u, v);
    if (place === view.chosenPlace) addKey(place);
    else if (place >= 0) {
      // Another patch is chosen first, with its light.
      view.chosenPlace = place;
      draw();
    }
    return;
  }
  const { pixels } = history.now.wish;
  const dot = dotAt(answer, pixels, u, v);
  if (dot) {
    addKey(answer.places.findIndex((each) => each.name === dot));
    return;
  }
  const [t_s, factor] = [answer.frames_s[view.frame], exposure()];
  try {
    const seen = await (await post("seen", { ...question(), x: u, y: v, t_s })).json();
    say();
    push(newDot(history.now.wish.pixels), seen.rgb, [u, v].map((x) => Number(x.toFixed(4))), t_s, factor);
  } catch (error) {
    say(error.message);
  }
}

function removeKey(number) {
  view.chosen = -1;
  wish((now) => {
    const [{ place }] = now.keys.splice(number, 1);
    if (now.pixels && !now.keys.some((key) => key.place === place)) {
      delete now.pixels[place];
      delete now.scene.spread?.strokes?.[place];
    }
  });
}

async function save(path, name) {
  try {
    const reply = await post(path, history.now);
    const link = tag("a");
    link.href = URL.createObjectURL(await reply.blob());
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    say();
  } catch (error) {
    say(error.message);
  }
}

const begun = (text) => text[0].toUpperCase() + text.slice(1);
const fileName = () => (history.now.wish.name || "design").replace(/[^\p{L}\p{N}_-]+/gu, "-");

const timeline = new Timeline({
  onFrame: show,
  onChosen: choose,
  onLight: (number) => {
    view.chosenLight = number;
    draw();
  },
  onKey: (number, { t_s, luminance: y, isTime, isLuminance }, gesture = null) => {
    changeKey(
      number,
      (key, judged) => ({
        ...(isLuminance ? withLuminance(key, judged, y) : key),
        at: isTime ? written(tidy(t_s)) : key.at,
      }),
      gesture,
    );
  },
  onSettled: () => history.settle(),
});
const keys = new Keys({
  onChosen: choose,
  onChange: changeKey,
  onRemove: removeKey,
  onSettled: () => history.settle(),
});
const light = new Light({
  timeShown: () => tidy(answer.frames_s[view.frame]),
  wishNow: () => history.now.wish,
  onWish: (change, chosen) => {
    if (chosen !== undefined) view.chosenLight = chosen;
    wish(change, null, true);
  },
  onChosen: (number) => {
    view.chosenLight = number;
    draw();
  },
});
const picture = new ScenePicture(post, () => drawTime());
const material = new Material({
  byHandNow: () => history.now.by_hand,
  onWish: (content) => wish((now) => ({ ...now, ...content })),
  onByHand: (parameters, gesture) => history.set({ wish: history.now.wish, by_hand: parameters }, `slider ${gesture}`),
  onSolve: () => history.set({ wish: history.now.wish, by_hand: null }),
  onSettled: () => {
    history.settle();
    draw();
  },
});

const spread = new Spread({
  onSpread: (change, gesture = null) => wish((now) => withSpread(now, change), gesture),
  onStroke: (dot, points) => {
    wish((now) => {
      const strokes = (now.scene.spread.strokes ??= {});
      (strokes[dot] ??= []).push(...points);
    }, "stroke");
  },
  onSettled: () => {
    history.settle();
    draw();
  },
});

$("undo").addEventListener("click", () => history.undo());
$("redo").addEventListener("click", () => history.redo());
$("name").addEventListener("change", (event) => {
  const name = event.target.value.trim();
  if (name) wish((now) => ({ ...now, name }), null, true);
});
$("frame").addEventListener("input", (event) => show(event.target.valueAsNumber));
$("add-key").addEventListener("click", () => addKey(placeNumber()));
const pointOf = (event) => {
  const box = $("picture").getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
};
$("picture").addEventListener("click", (event) => {
  if (view.wasDragged) view.wasDragged = false;
  else addKeyAt(...pointOf(event));
});
// A dot of a scene is dragged to another place of the material.
$("picture").addEventListener("pointerdown", (event) => {
  if (!answer?.scene) return;
  const start = pointOf(event);
  const { wish: now } = history.now;
  if (spread.begins(event, now)) {
    view.wasDragged = true;
    spread.stroke(start, pointOf, answer, now.pixels);
    return;
  }
  const dot = dotAt(answer, history.now.wish.pixels, ...start);
  if (!dot) return;
  let isMoved = false;
  view.wasDragged = false;
  const follow = (next) => {
    const point = pointOf(next);
    if (!isMoved && Math.hypot(point[0] - start[0], point[1] - start[1]) < 0.008) return;
    isMoved = view.wasDragged = true;
    wish((now) => {
      now.pixels[dot] = point.map((x) => Number(Math.min(Math.max(x, 0), 1).toFixed(4)));
    }, `dot ${dot}`, true);
  };
  whileDragged(follow, async () => {
    history.settle();
    await answered;
    // Off the material there is nothing to be dragged to.
    if (isMoved && document.body.dataset.refused) {
      history.undo();
      await answered;
      say("A dot stays on the material.");
    }
  });
});
$("picture").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -PAGE_FRAMES, PageDown: PAGE_FRAMES }[event.key];
  const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (answer.scene && event.shiftKey && move) {
    const [x, y] = view.cross ?? [0.5, 0.5];
    const within = (value) => Math.min(Math.max(value, 0), 1);
    view.cross = [within(x + move[0] * CROSS_STEP), within(y + move[1] * CROSS_STEP)];
    drawTime();
  } else if (step) show(view.frame + step);
  else if (event.key === "Enter" && answer.scene) {
    if (view.cross) addKeyAt(...view.cross);
    else say("Move the cross by Shift and arrows onto the material, or click there.");
  } else if (event.key === "Enter") addKey(placeNumber());
  else if (event.key === "Delete" && view.chosen >= 0) removeKey(view.chosen);
  else return;
  event.preventDefault();
});
$("timeline").addEventListener("keydown", (event) => {
  const key = event.target.closest("[data-key]");
  if (key && event.key === "Delete") removeKey(Number(key.dataset.key));
  else if (key && event.key === "Enter") choose(Number(key.dataset.key));
});
addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.target.matches("input:not([type=range]), select")) return;
  const isRedo = event.key === "y" || (event.shiftKey && event.key.toLowerCase() === "z");
  if (isRedo) history.redo();
  else if (event.key === "z") history.undo();
  else return;
  event.preventDefault();
});
$("exposure").addEventListener("change", (event) => {
  const isFixed = event.target.value === "fixed";
  $("ev").hidden = !isFixed;
  view.ev = isFixed ? $("ev").valueAsNumber : null;
  drawTime();
});
$("ev").addEventListener("input", (event) => {
  view.ev = event.target.valueAsNumber;
  drawTime();
});
$("play").addEventListener("click", () => {
  if (playing) {
    clearInterval(playing);
    playing = 0;
  } else {
    if (view.frame >= answer.frames_s.length - 1) view.frame = 0;
    playing = setInterval(() => {
      if (view.frame >= answer.frames_s.length - 1) $("play").click();
      else show(view.frame + 1);
    }, PLAY_MS);
  }
  $("play").textContent = playing ? "Stop" : "Play";
});
$("add-place").addEventListener("click", () => {
  wish((now) => {
    const from = answer.places[view.chosenPlace].name;
    let number = answer.places.length + 1;
    while (`patch ${number}` in now.places) number += 1;
    // A key that names no place would no longer be at one.
    now.keys = now.keys.map((key) => ({ ...key, place: key.place ?? from }));
    now.places[`patch ${number}`] = now.places[from];
    view.chosenPlace = answer.places.length;
  }, null, true);
});
$("remove-place").addEventListener("click", () => {
  const name = answer.places[view.chosenPlace].name;
  view.chosen = -1;
  wish((now) => {
    delete now.places[name];
    now.keys = now.keys.filter((key) => key.place !== name);
  });
});
$("save-material").addEventListener("click", async () => {
  await save("material.yaml", `${fileName()}.yaml`);
  if (!answer.places.some((each) => each.material)) return;
  await save("texture.npz", `${fileName()}-texture.npz`);
  say(`In the scene, beside both files: materials: {${answer.scene.material}: {file: ${fileName()}.yaml, texture: ${fileName()}-texture.npz}}`);
});
$("save-constraints").addEventListener("click", () => save("constraints.yaml", `${fileName()}-keys.yaml`));
$("save-picture").addEventListener("click", () => save("picture.png", `${fileName()}.png`));
$("open").addEventListener("change", async (event) => {
  const [file] = event.target.files;
  if (!file) return;
  try {
    const { wish: opened } = await (await post("open", { text: await file.text() })).json();
    view.chosen = -1;
    view.chosenPlace = 0;
    history.set({ wish: opened, by_hand: null });
  } catch (error) {
    say(error.message);
  }
  event.target.value = "";
});
$("render-again").addEventListener("click", async () => {
  const asked = history.now;
  const list = $("rendered-again");
  list.replaceChildren(tag("li", "The scene is rendered with the light of the glow itself …"));
  try {
    const { lines, parameters } = await (await post("again", asked)).json();
    if (JSON.stringify(history.now.wish) !== JSON.stringify(asked.wish)) {
      list.replaceChildren(tag("li", "The wish has changed since; render again."));
      return;
    }
    list.replaceChildren(...lines.map((text) => tag("li", text)));
    if (parameters) history.set({ wish: asked.wish, by_hand: parameters });
  } catch (error) {
    list.replaceChildren();
    say(error.message);
  }
});
$("find-nearest").addEventListener("click", async () => {
  $("nearest").replaceChildren(tag("li", "…"));
  try {
    const asked = history.now;
    const { nearest } = await (await post("nearest", asked)).json();
    if (JSON.stringify(history.now.wish) !== JSON.stringify(asked.wish)) {
      $("nearest").replaceChildren();
      return;
    }
    $("nearest").replaceChildren(...nearest.map((text) => tag("li", text.replace("nearest measured: ", ""))));
  } catch (error) {
    $("nearest").replaceChildren();
    say(error.message);
  }
});

function useTheme(isRed) {
  document.documentElement.dataset.theme = isRed ? "red" : "dark";
  $("theme").setAttribute("aria-pressed", String(isRed));
  localStorage.setItem("theme", isRed ? "red" : "dark");
  if (answer) draw();
}
$("theme").addEventListener("click", () => useTheme(document.documentElement.dataset.theme !== "red"));
useTheme(localStorage.getItem("theme") === "red");

$("preset").addEventListener("change", async (event) => {
  const name = event.target.value;
  event.target.value = "";
  if (!name) return;
  try {
    const { parameters } = await (await post("preset", { wish: history.now.wish, name })).json();
    history.set({ wish: { ...history.now.wish, states: parameters.k_r_per_s.length }, by_hand: parameters });
  } catch (error) {
    say(error.message);
  }
});

const { wish: first, presets } = await (await fetch("start")).json();
for (const name of presets) $("preset").append(new Option(name));
history = new History({ wish: first, by_hand: null }, changed);
changed();
