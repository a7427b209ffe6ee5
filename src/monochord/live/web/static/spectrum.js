// The spectrum and the level of each microphone.

import { estimate, touched } from "./state.js";

const FLOOR = -110, LOW = -100, LEVEL_FLOOR = -60;
const EDGE = { left: 34, right: 6, top: 18, bottom: 22 };

const signed = (value) => value.toFixed(0).replace("-", "−");

export class Spectra {
  constructor(place) {
    this.place = place;
    this.views = [];
  }

  reset(run) {
    this.run = run;
    this.views = Array.from({ length: Math.min(run.channels, 8) }, (_, k) => this.view(k));
    this.place.replaceChildren(...this.views.map((view) => view.root));
    document.getElementById("partials-note").hidden = !run.speed || run.channels !== 2;
  }

  view(k) {
    const root = document.createElement("div");
    root.className = "spectrum";
    const head = document.createElement("div");
    head.className = "head";
    const name = document.createElement("span"), meter = document.createElement("div"), level = document.createElement("span");
    name.className = "name";
    name.textContent = this.run.channels === 2 ? this.run.ends[k] : `microphone ${k + 1}`;
    level.className = "db";
    meter.className = "meter";
    meter.setAttribute("role", "meter");
    meter.setAttribute("aria-label", `Level of ${name.textContent} in decibels`);
    meter.setAttribute("aria-valuemin", String(LEVEL_FLOOR));
    meter.setAttribute("aria-valuemax", "0");
    const bar = document.createElement("div"), peak = document.createElement("div");
    bar.className = "bar";
    peak.className = "peak";
    meter.append(bar, peak);
    head.append(name, meter, level);
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Spectrum of ${name.textContent}`);
    root.append(head, canvas);
    return { root, canvas, context: canvas.getContext("2d"), meter, bar, peak, level, shown: null, target: null };
  }

  take({ top, rows }) {
    this.top = top;
    this.views.forEach((view, k) => { if (rows[k]) view.target = rows[k]; });
  }

  levels(moment) {
    moment.levels.forEach(([rms, peak], k) => {
      const view = this.views[k];
      if (!view) return;
      const share = (value) => (value === null ? 0 : Math.min(Math.max(1 - value / LEVEL_FLOOR, 0), 1));
      view.bar.style.transform = `scaleX(${share(rms)})`;
      view.peak.style.left = `calc(${100 * share(peak)}% - 2px)`;
      const text = rms === null ? "no sound" : moment.clips[k] ? `${signed(rms)} dB, clips` : `${signed(rms)} dB`;
      if (view.level.textContent !== text) {
        view.level.textContent = text;
        view.meter.setAttribute("aria-valuetext", text);
      }
      view.meter.setAttribute("aria-valuenow", rms === null ? String(LEVEL_FLOOR) : rms.toFixed(0));
    });
  }

  draw(moment, passed, colour) {
    if (!this.top) return;
    this.views.forEach((view, k) => this.one(view, k, moment, passed, colour));
  }

  one(view, k, moment, passed, colour) {
    if (!view.target) return;
    const ratio = Math.min(devicePixelRatio || 1, 2), { canvas, context: c } = view;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    view.shown ??= Float32Array.from(view.target);
    const rise = 1 - Math.exp(-passed / 0.03), fall = 1 - Math.exp(-passed / 0.15);
    let moved = 0;
    for (let n = 0; n < view.shown.length; n++) {
      const step = view.target[n] - view.shown[n];
      view.shown[n] += step * (step > 0 ? rise : fall);
      moved = Math.max(moved, Math.abs(step));
    }
    const drawn = [width, height, ratio, colour.ink, moment?.time].join(" ");
    if (moved < 0.5 && drawn === view.drawn) return; // nothing changed: the connection is lost, or the string silent
    view.drawn = drawn;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    const inner = width - EDGE.left - EDGE.right, base = height - EDGE.bottom;
    const x = (hertz) => EDGE.left + inner * hertz / this.top;
    const y = (db) => EDGE.top + (base - EDGE.top) * Math.min(Math.max(db / LOW, 0), 1);
    this.axes(c, x, y, base, width, colour);
    const bars = view.shown.length;
    c.beginPath();
    c.moveTo(EDGE.left, base);
    for (let n = 0; n < bars; n++) c.lineTo(EDGE.left + inner * (n + 0.5) / bars, y(FLOOR * (1 - view.shown[n] / 255)));
    c.lineTo(EDGE.left + inner, base);
    c.closePath();
    c.fillStyle = colour.spread;
    c.fill();
    c.strokeStyle = colour.estimate;
    c.lineWidth = 1.3;
    c.lineJoin = "round";
    c.stroke();
    this.partials(c, k, moment, x, colour);
  }

  axes(c, x, y, base, width, colour) {
    c.font = "11px system-ui, sans-serif";
    c.fillStyle = colour.muted;
    c.strokeStyle = colour.line;
    c.lineWidth = 1;
    c.textAlign = "right";
    for (const db of [0, -40, -80]) {
      c.beginPath(); c.moveTo(EDGE.left, y(db)); c.lineTo(width - EDGE.right, y(db)); c.stroke();
      c.fillText(db ? `−${-db}` : "0 dB", EDGE.left - 5, y(db) + 4);
    }
    c.textAlign = "center";
    for (let kilo = 0; kilo * 1e3 <= this.top; kilo += 2) {
      c.textAlign = kilo * 1e3 > this.top - 500 ? "right" : "center";
      c.fillText(kilo * 1e3 + 2000 > this.top ? `${kilo} kHz` : `${kilo}`, x(1e3 * kilo) + (c.textAlign === "right" ? 6 : 0), base + 15);
    }
  }

  // First partial, in Hz, of the segment at this microphone's side; of the whole string where nothing touches it.
  first(k, moment) {
    if (!moment || !this.run.speed || this.run.channels !== 2) return null;
    const position = touched(moment) ? estimate(moment, "position") : null;
    const segment = position ? (k ? this.run.length - position.value : position.value) : this.run.length;
    return segment > 2e-3 ? this.run.speed * (1 + (moment.pitch?.deviation ?? 0)) / (2 * segment) : null;
  }

  partials(c, k, moment, x, colour) {
    const first = this.first(k, moment);
    if (first === null) return;
    c.fillStyle = c.strokeStyle = colour.mark;
    c.textAlign = "center";
    c.font = "600 11px system-ui, sans-serif";
    for (let n = 1; n * first < this.top; n++) {
      const at = x(n * first);
      c.globalAlpha = n <= 6 ? 0.95 : 0.5;
      c.lineWidth = 1.4;
      c.beginPath(); c.moveTo(at, EDGE.top - 4); c.lineTo(at, EDGE.top + 7); c.stroke();
      if (n <= 9 && (n === 1 || x(first) - EDGE.left > 16)) c.fillText(String(n), at, EDGE.top - 7);
    }
    c.globalAlpha = 1;
  }
}
