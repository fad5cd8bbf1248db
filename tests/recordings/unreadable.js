// Lists what cannot be read on the page that is shown, each as `kind: text`.
const width = document.documentElement.clientWidth;
for (const details of document.querySelectorAll("details")) details.open = true;
const problems = [];
const add = (kind, text) => problems.push(`${kind}: ${text.replace(/\s+/g, " ").trim().slice(0, 90)}`);

// Nothing is cut at the right, and nothing has to be scrolled sideways.
for (const element of document.querySelectorAll("body *")) {
  if (element.closest("svg")) continue;
  const isCut = element.clientWidth > 0 && element.scrollWidth > element.clientWidth + 1;
  if (isCut || element.getBoundingClientRect().right > width + 0.5) {
    add("beyond the window", element.textContent);
  }
}

// No text of a figure covers another; a touch of the boxes does no harm.
for (const svg of document.querySelectorAll("svg")) {
  if (svg.parentElement.closest("svg")) continue;
  const texts = [...svg.querySelectorAll("text")].filter((text) => text.textContent.trim());
  const boxes = texts.map((text) => text.getBoundingClientRect());
  boxes.forEach((a, i) => boxes.slice(0, i).forEach((b, j) => {
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 0.05 * Math.min(a.width, b.width) && down > 0.35 * Math.min(a.height, b.height)) {
      add("overlap", `${svg.ariaLabel}: ${texts[j].textContent} and ${texts[i].textContent}`);
    }
  }));
}

// No two entries of a legend have samples that look the same.
for (const legend of document.querySelectorAll("svg .legend")) {
  const samples = new Map();
  for (const entry of legend.children) {
    const sample = [...entry.children].filter((element) => element.tagName !== "text")
      .map((element) => [element.tagName, element.getAttribute("style"),
        (element.getAttribute("d") || "").replace(/^M[\d.-]+ [\d.-]+/, "")].join()).join();
    if (samples.has(sample)) add("same in the legend", `${samples.get(sample)}, ${entry.textContent}`);
    samples.set(sample, entry.textContent);
  }
}

// Numbers and symbols are written as people write them.
const marks = {
  exponent: /\d[eE][+-]?\d/, caret: /\^/, percent: /\d%/, hyphen: /(^|[\s([])-\d/,
  underscore: /\b[A-Za-zΛ]_[a-z]/, list: /\[-?\d+\.\d/,
};
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const { textContent, parentElement } = walker.currentNode;
  if (parentElement.closest("pre, code, script, style, math")) continue;
  for (const [kind, pattern] of Object.entries(marks)) {
    if (pattern.test(textContent)) add(kind, textContent);
  }
}

// A quantity that always has a unit has it in its head, its row's name or its cell.
const quantity = /^(wavelength|exposure|time|lifetime|irradiance|luminance|distance|width|rate|peak|centroid)\b(?!.*(relative|ratio))/i;
const unit = /\/ ?[(\w⁻¹µ°%×]|\b(nm|ms|s|min|h|K|mm|cm|DN|px)\b|[%°]|s⁻¹|\b(W|lx|cd)\b/;
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent);
  for (const row of table.querySelectorAll("tbody tr")) {
    const name = row.querySelector("th")?.textContent ?? "";
    [...row.children].forEach((cell, column) => {
      const head = row.children.length === heads.length ? heads[column] : "";
      const about = [head, cell.tagName === "TD" ? name : ""].find((text) => quantity.test(text));
      const shown = cell.textContent.trim();
      if (about && /^[−(]?\d+(?![\d-])/.test(shown) && ![head, name, shown].some((text) => unit.test(text))) {
        add("no unit", `${about} ${shown}`);
      }
    });
  }
}

for (const link of document.querySelectorAll("a[href^='#']")) {
  if (!document.getElementById(decodeURIComponent(link.hash.slice(1)))) add("dead link", link.outerHTML);
}
return problems;
