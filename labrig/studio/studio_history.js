// What is designed: a wish and, if they were set by hand, parameters; with all that went before.

const MOST_STEPS = 300;

export class History {
  #past = [];
  #future = [];
  #now;
  #gesture = null;

  constructor(first, onChange) {
    this.#now = JSON.stringify(first);
    this.onChange = onChange;
  }

  /** A copy, which may be changed and given back to `set`. */
  get now() {
    return JSON.parse(this.#now);
  }

  /** Whether a gesture is under way: what it comes to is not known yet. */
  get isInGesture() {
    return this.#gesture !== null;
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  /** Goes on to another state. Changes of one gesture, such as a drag, are undone at once. */
  set(next, gesture = null) {
    const text = JSON.stringify(next);
    if (text === this.#now) return;
    if (gesture === null || gesture !== this.#gesture) {
      this.#past.push(this.#now);
      if (this.#past.length > MOST_STEPS) this.#past.shift();
    }
    this.#gesture = gesture;
    this.#future = [];
    this.#now = text;
    this.onChange();
  }

  /** Ends a gesture: the next change is undone apart. */
  settle() {
    if (!this.isInGesture) return;
    this.#gesture = null;
    this.onChange();
  }

  undo() {
    this.#step(this.#past, this.#future);
  }

  redo() {
    this.#step(this.#future, this.#past);
  }

  #step(from, to) {
    if (!from.length) return;
    to.push(this.#now);
    this.#now = from.pop();
    this.#gesture = null;
    this.onChange();
  }
}
