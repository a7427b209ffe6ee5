// A hand on the drawn string: mouse, finger, pen or keys become touches of the simulated one.

import { brief } from "./sections.js";

const element = (id) => document.getElementById(id);
const USUAL = 1.0; // N, with which a press begins
const PER_PIXEL = 0.012; // N
const EVERY = 25, AGAIN = 400; // ms between messages while it moves, and while it rests
const ACROSS = 0.02, FASTEST = 0.05; // m/s across the string: of a key that is held, and of a pointer at most

export class Hand {
  constructor(view, send) {
    this.view = view;
    this.send = send;
    this.run = null;
    this.said = { at: 0, position: 0, force: 0, across: 0 };
    this.across = { pointer: null, from: null, key: 0 }; // pixels of the pointer now and when last said
    this.pointer = null;
    this.keyed = { position: null, force: USUAL };
    const canvas = view.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(name, (event) => this.up(event));
    }
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("keyup", (event) => { if (event.key.startsWith("Page")) this.across.key = 0; });
    canvas.addEventListener("blur", () => this.lift());
    addEventListener("pagehide", () => this.lift());
  }

  allow(run) {
    this.run = run;
    const canvas = this.view.canvas, may = Boolean(run.controls);
    canvas.classList.toggle("touchable", may);
    if (!may) return;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "slider");
    canvas.setAttribute("aria-label", "Touch the string");
    canvas.setAttribute("aria-describedby", "where keys");
    canvas.setAttribute("aria-valuemin", "0");
    canvas.setAttribute("aria-valuemax", String(Math.round(1e3 * run.length)));
    this.keyed.position ??= 0.45 * run.length; // no node of the modes that drivers hold
    this.describe();
  }

  get may() { return Boolean(this.run?.controls); }

  down(event) {
    if (!this.may || event.button > 0 || this.pointer !== null) return;
    this.pointer = event.pointerId;
    this.view.canvas.setPointerCapture(event.pointerId);
    this.from = event.clientY;
    this.pressed = USUAL;
    this.across.pointer = this.across.from = null;
    this.move(event);
  }

  move(event) {
    if (event.pointerId !== this.pointer) return;
    const pen = event.pointerType === "pen" && event.pressure > 0;
    if (pen) this.pressed = 2.5 * event.pressure;
    if (pen || event.shiftKey !== (element("vertical").value === "across")) this.across.pointer = event.clientY;
    else {
      this.pressed += PER_PIXEL * (event.clientY - this.from);
      this.across.pointer = this.across.from = null;
    }
    this.from = event.clientY;
    this.lead(this.at(event), this.pressed);
    this.pressed = this.view.hand.force;
  }

  up(event) {
    if (event.pointerId !== this.pointer) return;
    this.pointer = null;
    this.lift();
  }

  at(event) {
    const left = this.view.canvas.getBoundingClientRect().left;
    return this.view.position(event.clientX - left, this.run.length);
  }

  lead(position, force) {
    const { positions, forces } = this.run.controls;
    const within = (value, [low, high]) => Math.min(Math.max(value, low), high);
    this.view.hand = { position: within(position, positions), force: within(force, forces), across: this.said.across };
    this.keyed = { position: this.view.hand.position, force: this.view.hand.force };
    this.describe();
  }

  lift() {
    if (!this.view.hand) return;
    this.view.hand = null;
    Object.assign(this.said, { at: 0, across: 0 });
    this.across.key = 0;
    this.send({ do: "release" });
    this.describe();
  }

  // Called for every frame: says where the hand is, no more often than it moves.
  tell(now) {
    const hand = this.view.hand;
    if (!hand || now - this.said.at < EVERY) return;
    hand.across = this.speed(now);
    const moved = ["position", "force", "across"].some((name) => hand[name] !== this.said[name]);
    if (!moved && now - this.said.at < AGAIN) return;
    this.said = { at: now, ...hand };
    this.send({ do: "touch", position: hand.position, force: hand.force, across: hand.across });
  }

  // How fast it is drawn across the string, in m/s; a pixel across is as far as one along.
  speed(now) {
    const { pointer, from, key } = this.across;
    this.across.from = pointer;
    if (pointer === null || from === null) return key;
    const metres = (pointer - from) * this.view.metres(this.run.length);
    const speed = 0.5 * this.said.across + 0.5e3 * metres / Math.max(now - this.said.at, EVERY);
    return Math.abs(speed) < 1e-3 ? 0 : Math.min(Math.max(speed, -FASTEST), FASTEST);
  }

  key(event) {
    if (!this.may) return;
    const { position, force } = this.keyed, step = (event.shiftKey ? 5e-3 : 1e-3);
    const [first, last] = this.run.range ?? this.run.controls.positions;
    const led = {
      ArrowLeft: [position - step, force], ArrowRight: [position + step, force],
      ArrowUp: [position, force + 0.1], ArrowDown: [position, force - 0.1],
      Home: [first, force], End: [last, force],
    }[event.key];
    if (event.key === " " || event.key === "Enter") {
      if (this.view.hand) this.lift();
      else this.lead(position, force);
    } else if (event.key.startsWith("Page") && this.view.hand) {
      this.across.key = event.key === "PageUp" ? -ACROSS : ACROSS;
    } else if (event.key === "Escape") {
      this.lift();
    } else if (led && this.view.hand) {
      this.lead(...led);
    } else if (led) {
      [this.keyed.position, this.keyed.force] = led;
      this.describe();
    } else {
      return;
    }
    event.preventDefault();
  }

  describe() {
    const { position, force } = this.keyed, millimetres = Math.round(1e3 * position), { range } = this.run;
    const outside = range && (position < range[0] || position > range[1]) ? ", outside the sensing range" : "";
    this.view.canvas.setAttribute("aria-valuenow", String(millimetres));
    this.view.canvas.setAttribute("aria-valuetext",
      `${this.view.hand ? "pressed" : "not pressed"} at ${millimetres} millimetres${outside}, ${force.toFixed(1)} newtons`);
  }
}

// The settings of the source as menus, and those that are not as usual in a line.
export function showSettings(settings, send) {
  const place = element("settings"), usual = ["none", "as built"];
  brief("controls", settings.map(({ value }) => value.replaceAll("_", " ")).filter((value) => !usual.includes(value)).join(", "));
  for (const { name, choices, value } of settings) {
    let select = place.querySelector(`select[name="${name}"]`);
    if (!select) {
      const label = document.createElement("label");
      label.append(name[0].toUpperCase() + name.slice(1));
      select = document.createElement("select");
      select.name = name;
      select.append(...choices.map((choice) => new Option(choice.replaceAll("_", " "), choice)));
      const chosen = select;
      select.addEventListener("change", () => {
        chosen.dataset.until = String(performance.now() + 1000); // the choice is shown until it is in effect
        send({ do: "change", name, value: chosen.value });
      });
      label.append(select);
      place.append(label);
    }
    const waits = Number(select.dataset.until ?? 0) > performance.now();
    if (!waits && select.value !== value && document.activeElement !== select) select.value = value;
  }
}
