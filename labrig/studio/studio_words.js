// Elements, times and numbers as people read them, and as a file of wishes has them.

export const $ = (id) => document.getElementById(id);

export function tag(name, text, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

export function field(kind, attributes) {
  const made = tag("input");
  made.type = kind;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

export function svg(name, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

const raised = (power) =>
  [...String(power)].map((each) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[each] ?? "⁻").join("");

export const powerOfTen = (power) => (power >= -2 && power <= 3 ? String(10 ** power) : `10${raised(power)}`);

/** A number with few digits, without an exponent where that is readable. */
export function short(value, digits = 3) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e5) return String(Number(value.toPrecision(digits)));
  const [head, power] = value.toExponential(digits - 1).split("e");
  return `${Number(head)} × 10${raised(Number(power))}`;
}

/** Calls `follow` while a pointer is dragged, and `end` once, whatever ends it. */
export function whileDragged(follow, end) {
  const ends = ["pointerup", "pointercancel", "blur"];
  const done = () => {
    removeEventListener("pointermove", follow);
    for (const name of ends) removeEventListener(name, done);
    end();
  };
  addEventListener("pointermove", follow);
  for (const name of ends) addEventListener(name, done);
}

/** Seconds of a time as a file has it, such as "300 s". */
export const seconds = (text) => Number.parseFloat(text);
/** A time as a file has it. */
export const written = (s) => `${Number(s.toPrecision(9))} s`;

export function duration(s) {
  if (s < 0) return `−${duration(-s)}`;
  if (s >= 3600) {
    const minutes = Math.round(s / 60);
    return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
  }
  if (s >= 60) {
    const tenths = s < 600 ? Math.round(10 * s) / 10 : Math.round(s);
    return `${Math.floor(tenths / 60)} min ${Number((tenths % 60).toFixed(1))} s`;
  }
  return `${short(s)} s`;
}
