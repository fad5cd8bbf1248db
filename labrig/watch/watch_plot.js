// The decay so far, as an SVG with axes.

const NS = "http://www.w3.org/2000/svg";
// Okabe and Ito: told apart by everybody.
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
// Of more series than colours, each round has its own shape: a circle, a square, a triangle, a cross.
const SHAPES = [
  "M-3.2,0a3.2,3.2 0 1,0 6.4,0a3.2,3.2 0 1,0 -6.4,0z",
  "M-3,-3h6v6h-6z",
  "M0,-4l4,7h-8z",
  "M-3.6,-2l1.6,-1.6l2,2l2,-2l1.6,1.6l-2,2l2,2l-1.6,1.6l-2,-2l-2,2l-1.6,-1.6l2,-2z",
];
const MARGIN = { left: 64, right: 14, top: 12, bottom: 46 };

function element(name, attributes, text) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** A path that marks the `number`-th series at (x, y). */
function marker(number, x, y) {
  const shape = SHAPES[Math.floor(number / COLOURS.length) % SHAPES.length];
  const fill = COLOURS[number % COLOURS.length];
  // where series lie upon one another, each is seen behind the next
  const scale = Math.max(0.6, 1.25 - 0.2 * number);
  return element("path", { class: "marker", d: shape, fill, transform: `translate(${x} ${y}) scale(${scale})` });
}

/** The marker alone, for a legend. */
export function sample(number) {
  const svg = element("svg", { viewBox: "-5 -5 10 10", width: 11, height: 11, "aria-hidden": true });
  svg.append(marker(number, 0, 0));
  return svg;
}

/** Round numbers that divide a range into some `about` steps. */
export function ticks(low, high, about) {
  const rough = (high - low) / about;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
  const made = [];
  for (let n = Math.ceil(low / step); n * step <= high * (1 + 1e-9); n += 1) made.push(n * step);
  return made;
}

function decades(low, high) {
  if (high / low < 8) return ticks(low, high, 4);
  const made = [];
  for (let n = Math.floor(Math.log10(low)); 10 ** n <= high; n += 1) {
    for (const factor of high / low < 200 ? [1, 2, 5] : [1]) {
      const value = factor * 10 ** n;
      if (value >= low && value <= high) made.push(value);
    }
  }
  return made;
}

function written(value) {
  // longer ones would run into the axis' title
  if (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5)) {
    return String(Number(value.toPrecision(3)).toExponential()).replace("e+", "e");
  }
  return String(Number(value.toPrecision(6)));
}

/** Draw `series`: [[[t_s, value], …], …]; true if there was anything. */
export function draw(svg, series, logarithmic) {
  const width = svg.clientWidth || 800;
  const height = svg.clientHeight || 450;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const shown = series.map((points) => points.filter(([, value]) => !logarithmic || value > 0));
  const all = shown.flat();
  const inner = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
  if (!all.length) {
    svg.append(element("text", { x: width / 2, y: height / 2, "text-anchor": "middle" },
      "No frame of a decay yet"));
    return false;
  }
  const lastS = Math.max(...all.map(([t]) => t), 1) * 1.02;
  const values = all.map(([, value]) => value);
  const high = Math.max(...values) * (logarithmic ? 1.4 : 1.05) || 1;
  const low = logarithmic ? Math.min(...values) / 1.4 : Math.min(0, ...values);
  const across = (t) => MARGIN.left + (inner[0] * t) / lastS;
  const fraction = logarithmic
    ? (v) => Math.log(v / low) / Math.log(high / low)
    : (v) => (v - low) / (high - low);
  const down = (v) => MARGIN.top + inner[1] * (1 - fraction(v));

  for (const t of ticks(0, lastS, width / 75)) {
    svg.append(
      element("line", { class: "grid", x1: across(t), x2: across(t), y1: MARGIN.top, y2: MARGIN.top + inner[1] }),
      element("text", { x: across(t), y: height - MARGIN.bottom + 18, "text-anchor": "middle" }, written(t)),
    );
  }
  for (const v of logarithmic ? decades(low, high) : ticks(low, high, height / 60)) {
    svg.append(
      element("line", { class: "grid", x1: MARGIN.left, x2: MARGIN.left + inner[0], y1: down(v), y2: down(v) }),
      element("text", { x: MARGIN.left - 8, y: down(v) + 4, "text-anchor": "end" }, written(v)),
    );
  }
  svg.append(
    element("path", {
      class: "axis", fill: "none",
      d: `M${MARGIN.left},${MARGIN.top}v${inner[1]}h${inner[0]}`,
    }),
    element("text", { x: MARGIN.left + inner[0] / 2, y: height - 8, "text-anchor": "middle" },
      "Time after lamp off / s"),
    element("text", {
      x: 0, y: 0, "text-anchor": "middle",
      transform: `translate(14 ${MARGIN.top + inner[1] / 2}) rotate(-90)`,
    }, "Signal / (DN/s)"),
  );
  shown.forEach((points, number) => {
    svg.append(...points.map(([t, value]) => marker(number, across(t), down(value))));
  });
  return true;
}
