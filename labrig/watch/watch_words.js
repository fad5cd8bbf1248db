// Elements and numbers as people read them.

export function tag(name, text, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

export function duration(s) {
  const whole = Math.max(0, Math.round(s));
  if (whole >= 3600) return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
  if (whole >= 60) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${whole} s`;
}

export function exposure(s) {
  return s < 0.3 ? `1/${Math.round(1 / s)} s` : `${Number(s.toPrecision(3))} s`;
}

/** Items by what `key` says of them, in the order in which that first comes. */
export function grouped(items, key) {
  const groups = new Map();
  for (const item of items) {
    if (!groups.has(key(item))) groups.set(key(item), []);
    groups.get(key(item)).push(item);
  }
  return groups;
}

/** A time of day by the clock on the wall. */
export function timeOfDay(date) {
  return date.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
}
