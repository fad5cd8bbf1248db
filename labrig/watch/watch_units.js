// The units of a run, those of a chain by part. What a person folds or unfolds stays so until
// another part begins.

import { duration, tag } from "./watch_words.js";

const MARKS = { done: "✓", now: "●", again: "↻", "to do": "·" };

let parts = [];
let rows = [];
let shown = null;

function partOf(name) {
  const [part, ...rest] = name.split("/");
  return rest.length ? [part, rest.join("/")] : ["", name];
}

function build(place, units) {
  parts = [];
  shown = null;
  rows = units.map((unit, number) => {
    const [name, own] = partOf(unit.name);
    if (!parts.length || parts.at(-1).name !== name) {
      const box = tag(name ? "details" : "div", undefined, "part");
      const list = tag("ol");
      const said = tag("span");
      const bar = tag("i", undefined, "bar");
      if (name) {
        const head = tag("summary");
        head.append(tag("b", name), said, bar);
        box.append(head);
      }
      box.append(list);
      parts.push({ name, box, list, said, bar, units: [] });
    }
    const part = parts.at(-1);
    const row = { line: tag("li"), mark: tag("em"), said: tag("span"), bar: tag("i", undefined, "bar"), part };
    row.mark.setAttribute("aria-hidden", "true");
    row.line.append(row.mark, tag("b", own), row.said, row.bar);
    part.list.append(row.line);
    part.units.push(number);
    return row;
  });
  place.replaceChildren(...parts.map((part) => part.box));
}

function saidOf(unit, at) {
  const tries = unit.tries > 1 ? `, try ${unit.tries}` : "";
  if (unit.state === "done") return `done${tries}`;
  if (unit.state === "now") return `${duration(unit.planned_s - at)} left${tries}`;
  if (unit.state === "again") return "to be done again";
  return duration(unit.planned_s);
}

/** What is still planned for a unit, in seconds; `at` is where the current one stands. */
function leftS(unit, at) {
  if (unit.state === "done") return 0;
  return unit.planned_s - (unit.state === "now" ? at : 0);
}

function showPart(part, units, at) {
  const own = part.units.map((number) => units[number]);
  const done = own.filter((unit) => unit.state === "done").length;
  const left = own.reduce((sum, unit) => sum + leftS(unit, at), 0);
  const planned = own.reduce((sum, unit) => sum + unit.planned_s, 0);
  const isDone = done === own.length;
  part.said.textContent = isDone ? `${done} done` : `${done} of ${own.length} done, ${duration(left)} left`;
  part.bar.style.setProperty("--done", isDone || !planned ? Number(isDone) : 1 - left / planned);
  const isNow = own.some((unit) => unit.state === "now");
  part.box.className = `part ${isDone ? "done" : isNow ? "now" : ""}`;
}

/** Where attention belongs: the unit under way, else the first that is left to do. */
function centre(units) {
  const now = units.findIndex((unit) => unit.state === "now");
  return now >= 0 ? now : units.findIndex((unit) => unit.state !== "done");
}

/** Unfold the part that the run has come to, and bring its unit into view within the list. */
function follow(place, number) {
  if (number === shown) return;
  const part = rows[number]?.part;
  if (shown === null || part !== rows[shown]?.part) {
    for (const one of parts) one.box.open = one === part;
  }
  shown = number;
  if (!part) return;
  const line = part.box.open || !part.name ? rows[number].line : part.box;
  place.scrollTop = line.offsetTop - (place.clientHeight - line.offsetHeight) / 2;
}

/** Show `units`, in order; the current one stands at `at` seconds of its plan. */
export function showUnits(place, units, at) {
  if (rows.length !== units.length) build(place, units);
  units.forEach((unit, number) => {
    const { line, mark, said, bar } = rows[number];
    line.className = unit.state.replace(" ", "-");
    mark.textContent = MARKS[unit.state];
    said.textContent = saidOf(unit, at);
    bar.hidden = unit.state !== "now";
    bar.style.setProperty("--done", Math.min(1, at / unit.planned_s));
  });
  for (const part of parts) if (part.name) showPart(part, units, at);
  follow(place, centre(units));
}
