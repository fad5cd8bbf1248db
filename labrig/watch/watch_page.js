// Shows what the server tells: first all of it, which stands in the page, then what is new; asks
// again by itself, for what it lacks, when the connection breaks.

import { draw, sample } from "./watch_plot.js";
import { showUnits } from "./watch_units.js";
import { duration, exposure, grouped, tag, timeOfDay } from "./watch_words.js";

const $ = (id) => document.getElementById(id);
const NOTHING_NEXT = {
  running: "Between two attempts.",
  interrupted: "Nobody is at it. Go on with: labrig resume",
  failed: "A fault ended it. Go on with: labrig resume",
  recorded: "Everything is recorded; the analysis follows, or else: labrig process",
  processed: "Done.",
};
const MOST_TROUBLES = 5;
const state = { run: {}, units: {}, points: {}, frame: {}, troubles: {}, results: {} };
let number = 0;
let isConnected = true;

function take(news) {
  number = news.number;
  for (const [section, things] of Object.entries(news.things)) {
    for (const [key, value] of Object.entries(things)) {
      if (value === null) delete state[section][key];
      else state[section][key] = value;
    }
  }
}

/** Time in the room, in seconds since 1970: a simulated one only moves with its journal. */
function now() {
  const { simulated, last_time } = state.run;
  return simulated || state.run.status !== "running" ? last_time : Date.now() / 1000;
}

/** Where the unit under way is in its plan; no further than what the journal has to tell next. */
function position() {
  const standing = state.run.now;
  if (!standing) return 0;
  const waited = Math.max(0, now() - standing.time);
  return Math.max(standing.at_s, Math.min(standing.at_s + waited, standing.until_s));
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
  const all = Object.values(state.points).flat();
  $("decay").hidden = !all.length;
  // where nothing decays, or not yet, the last frame has the room
  const place = $(all.length ? "right" : "left");
  if ($("frame").parentElement !== place) place.append($("frame"));
  if (!all.length) return;
  const parts = grouped(all, (point) => point.unit.split("/").slice(0, -1).join("/"));
  const series = new Map();
  for (const [part, points] of parts) {
    for (const [patch, own] of grouped(points, (point) => point.patch)) {
      const channel = brightest(own);
      const name = `${part ? `${part}: ` : ""}${patch}, ${channel}`;
      series.set(name, own.map((point) => [point.t_s, point.dn_per_s[channel]]));
    }
  }
  $("legend").replaceChildren(...[...series.keys()].map((name, order) => {
    const entry = tag("span");
    entry.append(sample(order), name);
    return entry;
  }));
  draw($("plot"), [...series.values()], $("log").checked);
}

function showFrame() {
  const { frame } = state;
  if (!frame.name) return;
  const picture = $("picture");
  if (picture.dataset.name !== frame.name) {
    picture.src = `frame.jpg?name=${encodeURIComponent(frame.name)}`;
    picture.dataset.name = frame.name;
    picture.style.aspectRatio = `${frame.width} / ${frame.height}`;
    picture.hidden = false;
  }
  $("frame-name").textContent = frame.name;
  const late = frame.late_s > 0.02 ? `, ${(1000 * frame.late_s).toFixed(0)} ms late` : "";
  $("frame-said").textContent =
    `${frame.unit}: ${frame.role}, ${exposure(frame.exposure_s)}, ISO ${frame.iso}${late}; `
    + `brightened ${frame.brightened} ×`;
  const channels = Object.keys(Object.values(frame.values)[0] ?? {});
  const head = tag("tr");
  head.append(tag("th", "DN above black"), ...channels.map((channel) => tag("th", channel)));
  const rows = Object.entries(frame.values).map(([patch, values]) => {
    const clipped = frame.clipped.includes(patch);
    const row = tag("tr");
    row.append(
      tag("td", clipped ? `${patch} (clipped)` : patch, clipped ? "clipped" : ""),
      ...channels.map((channel) => tag("td", values[channel]?.toFixed(1) ?? "–")),
    );
    return row;
  });
  $("values").replaceChildren(...(rows.length ? [head, ...rows] : []));
}

function step(when, what, kind) {
  const entry = tag("li", undefined, kind);
  entry.append(tag("b", when), tag("span", what));
  return entry;
}

/** What there is to do without a unit under way; it stays as it is, so that its link can be clicked. */
function showEnd(status) {
  if ($("steps").dataset.end === status) return;
  $("steps").dataset.end = status;
  const entry = tag("li", `${NOTHING_NEXT[status]} `, "alone");
  if (status === "processed") {
    const link = tag("a", "Open the report");
    link.href = "result/report.html";
    entry.append(link);
  }
  $("steps").replaceChildren(entry);
}

function showSteps() {
  const standing = state.run.now;
  $("unit").textContent = standing ? state.units[standing.unit].name : "";
  if (!standing) {
    showEnd(state.run.status);
    return;
  }
  delete $("steps").dataset.end;
  const at = position();
  const past = standing.done.map(({ time, what }) => step(`${duration(now() - time)} ago`, what, "past"));
  // of what has begun, only the last is under way
  const begun = standing.next.findLastIndex(({ at_s }) => at_s <= at);
  const next = standing.next.slice(Math.max(0, begun)).map(({ at_s, what }, order) => {
    const isNow = begun >= 0 && order === 0;
    return step(isNow ? "now" : `in ${duration(at_s - at)}`, what, isNow ? "now" : "");
  });
  $("steps").replaceChildren(...past, ...next);
}

function showProgress() {
  const { run } = state;
  const units = Object.values(state.units);
  const at = position();
  showSteps();
  showUnits($("units"), units, at);
  const left = run.now ? run.now.ends_s - at : 0;
  $("left-s").textContent = left > 0 ? `${duration(left)} left, as planned` : "";
  const byHand = run.now?.by_hand;
  const due = byHand ? new Date(1000 * (now() + byHand.at_s - at)) : null;
  $("by-hand").textContent = due ? `Next by hand at ${timeOfDay(due)}: ${byHand.what}` : "";
  const not = run.discarded_frames ? `; ${run.discarded_frames} more do not count` : "";
  $("frames").textContent = `${run.frames} of at most ${run.planned_frames} frames${not}`;
  $("disk").textContent = `${(run.disk_free_bytes / 1e9).toFixed(1)} GB free on the disk`;
}

function showResults() {
  $("results").replaceChildren(...Object.entries(state.results).map(([patch, parameters]) => {
    const row = tag("tr");
    row.append(tag("td", patch), tag("td", parameters));
    return row;
  }));
  $("results-section").hidden = !Object.keys(state.results).length;
}

function showTroubles() {
  const all = Object.values(state.troubles);
  const line = ({ unit, reason }) => tag("li", `${unit}: ${reason}`);
  const open = all.filter((trouble) => !trouble.mended);
  const mended = all.filter((trouble) => trouble.mended);
  $("open-troubles").replaceChildren(...open.slice(-MOST_TROUBLES).map(line));
  if (open.length > MOST_TROUBLES) {
    $("open-troubles").prepend(tag("li", `and ${open.length - MOST_TROUBLES} before`));
  }
  const [summary, list] = $("mended").children;
  summary.textContent = mended.length === 1
    ? "1 attempt did not count; its unit was done again"
    : `${mended.length} attempts did not count; their units were done again`;
  list.replaceChildren(...mended.map(line));
  $("mended").hidden = !mended.length;
  $("troubles").hidden = !all.length;
  $("troubles").classList.toggle("open", open.length > 0);
}

function show() {
  const { run } = state;
  document.title = `${run.sample} – labrig`;
  $("sample").textContent = run.sample;
  $("run").textContent = `${run.name}${run.simulated ? " (simulated)" : ""}`;
  $("state").textContent = isConnected ? run.status : "connection lost, trying again";
  $("state").className = `state ${isConnected ? run.status : "lost"}`;
  $("page").hidden = false;
  showTroubles();
  showProgress();
  showResults();
  showFrame();
  showDecay();
}

function listen() {
  const source = new EventSource(`events?after=${number}`);
  source.onmessage = (event) => {
    isConnected = true;
    take(JSON.parse(event.data));
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
setInterval(() => { if (isConnected) showProgress(); }, 1000);
take(JSON.parse($("first").textContent));
show();
listen();
