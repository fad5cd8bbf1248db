// Regions on the picture: drawn, moved, resized, named. Fractions of the frame throughout.

const SMALLEST = 0.005;
const STEP = 0.005;
const CORNERS = ["nw", "ne", "sw", "se"];

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
export const rounded = (value) => Math.round(value * 1e4) / 1e4;

export class Regions {
  // `changed` is called after every change, `chosen` of which region is selected included.
  constructor(stage, layer, list, changed) {
    this.stage = stage;
    this.layer = layer;
    this.list = list;
    this.changed = changed;
    this.items = [];
    this.chosen = null;
    this.pixels = [0, 0];
    stage.addEventListener("pointerdown", (event) => this.#press(event));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.choose(null);
    });
  }

  load(patches) {
    for (const { name, region } of patches) this.#make(name, region);
    this.#tell();
  }

  setPixels(width, height) {
    if (this.pixels[0] === width && this.pixels[1] === height) return;
    this.pixels = [width, height];
    for (const item of this.items) this.#place(item);
  }

  get patches() {
    return this.items.map((item) => ({ name: item.name.trim(), region: item.region.map(rounded) }));
  }

  // What is wrong with the names, or null.
  get problem() {
    const names = this.patches.map((patch) => patch.name);
    if (names.includes("")) return "A region has no name.";
    const twice = names.find((name, at) => names.indexOf(name) !== at);
    return twice === undefined ? null : `Two regions are called “${twice}”.`;
  }

  add() {
    const item = this.#make(this.#freeName(), [0.4, 0.4, 0.2, 0.2]);
    this.choose(item);
    item.input.focus();
    item.input.select();
  }

  choose(item) {
    if (this.chosen === item) return;
    this.chosen = item;
    for (const other of this.items) {
      other.box.classList.toggle("chosen", other === item);
      other.row.classList.toggle("chosen", other === item);
    }
    this.#tell();
  }

  #freeName() {
    const taken = new Set(this.patches.map((patch) => patch.name));
    if (!taken.has("sample")) return "sample";
    let number = 2;
    while (taken.has(`sample-${number}`)) number += 1;
    return `sample-${number}`;
  }

  #make(name, region) {
    const item = { name, region: [...region] };
    item.box = document.createElement("div");
    item.box.className = "region";
    item.box.tabIndex = 0;
    item.box.setAttribute("role", "group");
    item.label = document.createElement("b");
    item.box.append(item.label);
    for (const corner of CORNERS) {
      const handle = document.createElement("span");
      handle.className = "corner";
      handle.dataset.corner = corner;
      item.box.append(handle);
    }
    item.box.addEventListener("focus", () => this.choose(item));
    item.box.addEventListener("keydown", (event) => this.#key(event, item));

    item.row = document.createElement("li");
    const line = document.createElement("div");
    line.className = "row";
    item.input = document.createElement("input");
    item.input.maxLength = 60;
    item.input.spellcheck = false;
    item.input.setAttribute("aria-label", "Name of the region");
    item.input.value = name;
    const remove = document.createElement("button");
    remove.type = "button";
    remove.textContent = "Remove";
    line.append(item.input, remove);
    item.size = document.createElement("small");
    item.row.append(line, item.size);
    item.row.addEventListener("pointerdown", () => this.choose(item));
    item.input.addEventListener("focus", () => this.choose(item));
    item.input.addEventListener("input", () => {
      item.name = item.input.value;
      this.#place(item);
      this.#tell();
    });
    remove.addEventListener("click", () => this.#remove(item));

    this.items.push(item);
    this.layer.append(item.box);
    this.list.append(item.row);
    this.#place(item);
    return item;
  }

  #remove(item) {
    const at = this.items.indexOf(item);
    this.items.splice(at, 1);
    item.box.remove();
    item.row.remove();
    this.chosen = null;
    const next = this.items[Math.min(at, this.items.length - 1)];
    if (next) this.choose(next);
    else this.#tell();
  }

  #place(item) {
    const [x, y, width, height] = item.region;
    const percent = (value) => `${value * 100}%`;
    Object.assign(item.box.style, {
      left: percent(x),
      top: percent(y),
      width: percent(width),
      height: percent(height),
    });
    item.label.textContent = item.name;
    item.box.setAttribute("aria-label", `Region ${item.name}: arrows move, Shift and arrows resize`);
    const [wide, high] = this.pixels;
    const inPixels = wide ? `${Math.round(width * wide)} × ${Math.round(height * high)} px` : "";
    const fractions = document.createElement("span");
    fractions.textContent = item.region.map((value) => value.toFixed(3)).join(", ");
    const size = document.createElement("span");
    size.textContent = inPixels;
    size.title = "in pixels of the live picture";
    item.size.replaceChildren(fractions, size);
  }

  #tell() {
    const names = this.patches.map((patch) => patch.name);
    for (const item of this.items) {
      const name = item.name.trim();
      const wrong = name === "" || names.filter((other) => other === name).length > 1;
      item.input.setAttribute("aria-invalid", String(wrong));
    }
    this.changed();
  }

  #key(event, item) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (way) {
      const [dx, dy] = way.map((value) => value * STEP);
      const [x, y, width, height] = item.region;
      if (event.shiftKey) this.#shape(item, x, y, x + width + dx, y + height + dy);
      else this.#move(item, x + dx, y + dy);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      this.#remove(item);
    } else {
      return;
    }
    event.preventDefault();
  }

  #move(item, x, y) {
    const [, , width, height] = item.region;
    item.region = [clamp(x, 0, 1 - width), clamp(y, 0, 1 - height), width, height];
    this.#place(item);
    this.#tell();
  }

  // From one corner to the opposite one, in any order.
  #shape(item, x1, y1, x2, y2) {
    const [left, right] = [x1, x2].map((v) => clamp(v, 0, 1)).sort((a, b) => a - b);
    const [top, low] = [y1, y2].map((v) => clamp(v, 0, 1)).sort((a, b) => a - b);
    const x = Math.min(left, 1 - SMALLEST);
    const y = Math.min(top, 1 - SMALLEST);
    item.region = [x, y, Math.max(right - x, SMALLEST), Math.max(low - y, SMALLEST)];
    this.#place(item);
    this.#tell();
  }

  #press(event) {
    if (event.button !== 0 || !event.isPrimary) return;
    event.preventDefault();
    const frame = this.stage.getBoundingClientRect();
    const at = (e) => [
      clamp((e.clientX - frame.left) / frame.width, 0, 1),
      clamp((e.clientY - frame.top) / frame.height, 0, 1),
    ];
    const [x0, y0] = at(event);
    const box = event.shiftKey ? null : event.target.closest(".region");
    let item = this.items.find((other) => other.box === box) ?? null;
    let drag;
    let drawn = false;
    if (item) {
      const [x, y, width, height] = item.region;
      const corner = event.target.dataset.corner;
      if (corner) {
        const fixedX = corner.endsWith("w") ? x + width : x;
        const fixedY = corner.startsWith("n") ? y + height : y;
        drag = (to) => this.#shape(item, fixedX, fixedY, ...to);
      } else {
        drag = ([x1, y1]) => this.#move(item, x + x1 - x0, y + y1 - y0);
      }
      item.box.focus({ preventScroll: true });
    } else {
      document.activeElement?.blur();
      drag = (to) => {
        // A click is no region: one is made when the pointer has gone far enough.
        if (!item && Math.hypot((to[0] - x0) * frame.width, (to[1] - y0) * frame.height) > 6) {
          item = this.#make(this.#freeName(), [x0, y0, SMALLEST, SMALLEST]);
          drawn = true;
          this.choose(item);
        }
        if (item) this.#shape(item, x0, y0, ...to);
      };
    }
    this.choose(item);
    this.stage.setPointerCapture(event.pointerId);
    const move = (e) => drag(at(e));
    const end = () => {
      this.stage.removeEventListener("pointermove", move);
      this.stage.removeEventListener("pointerup", end);
      this.stage.removeEventListener("pointercancel", end);
      // On a phone the keyboard would cover what was just drawn.
      if (drawn && event.pointerType === "mouse") {
        item.input.focus({ preventScroll: true });
        item.input.select();
      }
    };
    this.stage.addEventListener("pointermove", move);
    this.stage.addEventListener("pointerup", end);
    this.stage.addEventListener("pointercancel", end);
  }
}
