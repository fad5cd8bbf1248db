// Shows what the server tells; asks again by itself when the connection breaks.

import { draw, sample } from "./watch_plot.js";

const $ = (id) => document.getElementById(id);
const NOTHING_NEXT = {
  unfinished: "Nobody is at it. Go on with: labrig resume",
  recorded: "Everything is recorded; the fit follows, or else: labrig process",
  processed: "Done; the report is in the run's folder: result/report.html",
  damaged: "The journal cannot be read.",
};
let state = null;
let isConnected = false;

function duration(s) {
  const whole = Math.max(0, Math.round(s));
  if (whole >= 3600) return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
  if (whole >= 60) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${whole} s`;
}

function tag(name, text, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

/** Time in the room, in seconds since 1970: a simulated one only moves with its journal. */
function now() {
  return state.simulated || state.state !== "running" ? state.last_time : Date.now() / 1000;
}

function brightest(points) {
  const sums = {};
  for (const point of points) {
    for (const [channel, value] of Object.entries(point.dn_per_s)) {
      sums[channel] = (sums[channel] ?? 0) + value;
    }
  }
  return Object.keys(sums).sort((a, b) => sums[b] - sums[a])[0];
}

function showDecay() {
  const series = new Map();
  for (const patch of new Set(state.points.map((point) => point.patch))) {
    const points = state.points.filter((point) => point.patch === patch);
    const channel = brightest(points);
    series.set(`${patch}, ${channel}`, points.map((p) => [p.t_s, p.dn_per_s[channel]]));
  }
  $("legend").replaceChildren(...[...series.keys()].map((name, number) => {
    const entry = tag("span");
    entry.append(sample(number), name);
    return entry;
  }));
  draw($("plot"), [...series.values()], $("log").checked);
}

function showFrame() {
  const frame = state.frame;
  if (!frame) return;
  const picture = $("picture");
  if (picture.dataset.name !== frame.name) {
    picture.src = `frame.jpg?name=${encodeURIComponent(frame.name)}`;
    picture.dataset.name = frame.name;
    picture.style.aspectRatio = `${frame.width} / ${frame.height}`;
    picture.hidden = false;
  }
  $("frame-name").textContent = frame.name;
  const exposure = frame.exposure_s < 0.3 ? `1/${Math.round(1 / frame.exposure_s)} s` : `${Number(frame.exposure_s.toPrecision(3))} s`;
  const late = frame.late_s > 0.02 ? `, ${(1000 * frame.late_s).toFixed(0)} ms late` : "";
  $("frame-said").textContent =
    `${frame.purpose}, ${exposure}, ISO ${frame.iso}${late}; brightened ${frame.brightened} ×`;
  const channels = Object.keys(Object.values(frame.values)[0] ?? {});
  const head = tag("tr");
  head.append(tag("th", "DN above black"), ...channels.map((channel) => tag("th", channel)));
  const rows = Object.entries(frame.values).map(([patch, values]) => {
    const clipped = frame.clipped.includes(patch);
    const row = tag("tr");
    row.append(
      tag("td", clipped ? `${patch} (clipped)` : patch, clipped ? "clipped" : ""),
      ...channels.map((channel) => tag("td", values[channel].toFixed(1))),
    );
    return row;
  });
  $("values").replaceChildren(head, ...rows);
}

function showSteps() {
  const at = state.unit_began_time === null ? 0 : now() - state.unit_began_time;
  const next = state.steps.findIndex((step) => step.at_s > at);
  const until = next < 0 ? state.steps.length : next;
  const shown = state.steps.slice(Math.max(0, until - 2), until + 4);
  $("steps").replaceChildren(...shown.map((step) => {
    const isPast = step.at_s <= at;
    const entry = tag("li", undefined, isPast ? "past" : step === state.steps[next] ? "now" : "");
    const when = isPast ? `${duration(at - step.at_s)} ago` : `in ${duration(step.at_s - at)}`;
    entry.append(tag("b", when), tag("span", step.what));
    return entry;
  }));
  if (!shown.length) $("steps").replaceChildren(tag("li", NOTHING_NEXT[state.state] ?? "–", "alone"));
  const left = state.units.reduce((sum, unit) => {
    if (unit.state === "done") return sum;
    return sum + Math.max(0, unit.planned_s - (unit.state === "now" ? at : 0));
  }, 0);
  $("left").textContent = left > 0 && state.state === "running" ? `${duration(left)} left at most` : "";
}

function showUnits() {
  const at = state.unit_began_time === null ? 0 : now() - state.unit_began_time;
  $("units").replaceChildren(...state.units.map((unit) => {
    const entry = tag("li", undefined, unit.state === "now" ? "now" : "");
    const done = { done: 1, now: Math.min(1, at / unit.planned_s), "to do": 0 }[unit.state];
    const bar = tag("i");
    bar.style.setProperty("--done", done);
    const tries = unit.tries > 1 ? ` (try ${unit.tries})` : "";
    entry.append(tag("b", unit.name + tries), bar, tag("span", duration(unit.planned_s)));
    return entry;
  }));
  $("frames").textContent = `${state.frames} of ${state.planned_frames} frames`;
  $("disk").textContent = `${(state.disk_free_bytes / 1e9).toFixed(1)} GB free on the disk`;
  $("results").replaceChildren(...state.results.map((result) => {
    const row = tag("tr");
    row.append(tag("td", result.patch), tag("td", `${result.rates} /s`));
    return row;
  }));
  $("results-head").hidden = !state.results.length;
}

function show() {
  if (!state) return;
  document.title = `${state.sample} – labrig`;
  $("sample").textContent = state.sample;
  $("run").textContent = `${state.run}${state.simulated ? " (simulated)" : ""}`;
  $("state").textContent = isConnected ? state.state : "connection lost, trying again";
  $("state").className = `state ${isConnected ? state.state : "lost"}`;
  $("trouble").hidden = !state.trouble.length;
  $("trouble").replaceChildren(...state.trouble.map((text) => tag("li", text)));
  showDecay();
  showFrame();
  showSteps();
  showUnits();
}

function listen() {
  const source = new EventSource("events");
  source.onmessage = (event) => {
    isConnected = true;
    state = JSON.parse(event.data);
    show();
  };
  source.onopen = () => { isConnected = true; show(); };
  source.onerror = () => {
    isConnected = false;
    show();
    // the browser gives up for good after some errors; then begin anew
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, 1000);
  };
}

$("log").addEventListener("change", show);
addEventListener("resize", show);
setInterval(() => { if (state && isConnected) { showSteps(); showUnits(); } }, 1000);
listen();
