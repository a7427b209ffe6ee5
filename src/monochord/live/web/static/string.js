// The drawn string: position, force as deflection, uncertainty as width, slip as motion.

import { decision, estimate, millimetres, reason, reasonKey, touched } from "./state.js";

const STILL = matchMedia("(prefers-reduced-motion: reduce)");

// What is said of a touch without a place. While it begins and ends, the newest window may have no contact.
function withheld(moment) {
  if (reasonKey(moment, "position") === "no_contact") return "touched";
  return `touched; ${reason(moment, "position") || "position not estimated"}`;
}

export class StringView {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.shown = { x: 0.5, depth: 0, spread: 0, presence: 0, withheld: 0, swing: [0, 0], truth: null };
    this.withheld = ""; // what is said of a touch without a place
    this.trail = [];
    this.before = 0;
    this.hand = null; // {position, force} of a pressing pointer or key
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const { clientWidth, clientHeight } = this.canvas;
    this.width = clientWidth;
    this.height = clientHeight;
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  // CSS pixels from the canvas's edge to an end of the string.
  get pad() { return this.width < 480 ? 24 : 34; }
  get rest() { return this.height * 0.42; }
  pixel(position, length) { return this.pad + (position / length) * (this.width - 2 * this.pad); }
  position(pixel, length) { return Math.min(Math.max((pixel - this.pad) / (this.width - 2 * this.pad), 0), 1) * length; }
  metres(length) { return length / (this.width - 2 * this.pad); } // of a pixel
  depth(force) { return Math.min(8 + 26 * force, this.height * 0.3); }

  draw(run, moment, now, colour) {
    const { context: c, width, height, rest } = this;
    const passed = Math.min((now - this.before) / 1000, 0.1);
    this.before = now;
    this.paper = colour.surface;
    this.band = run?.range && { ends: run.range.map((end) => this.pixel(end, run.length)), paper: colour.range };
    c.clearRect(0, 0, width, height);
    this.range(run, colour);
    this.ruler(run, colour);
    this.drivers(run, colour);
    if (!moment) return this.line([[this.pad, rest], [width - this.pad, rest]], colour.muted, 1.5);
    this.follow(run, moment, passed);
    const s = this.shown, at = this.pixel(s.x * run.length, run.length), tip = rest + s.depth * s.presence;
    if (s.presence > 0.02) this.spread(run, at, colour);
    this.slip(moment, at, tip, now, colour);
    this.segments(at, tip, now, colour);
    this.ends(run, colour);
    if (s.presence > 0.02) this.touch(at, tip, colour);
    if (s.withheld > 0.02) this.unplaced(colour);
    this.truth(run, moment, colour);
    if (this.hand) this.ring(run, colour);
  }

  // Approach what was said last, so that 30 messages a second move at the screen's own pace.
  follow(run, moment, passed) {
    const s = this.shown, quick = 1 - Math.exp(-passed / 0.05), slow = 1 - Math.exp(-passed / 0.12);
    const is = touched(moment), position = estimate(moment, "position"), force = estimate(moment, "force");
    s.presence += ((is && position ? 1 : 0) - s.presence) * quick;
    s.withheld += ((is && !position ? 1 : 0) - s.withheld) * slow;
    if (is && !position) this.withheld = withheld(moment);
    if (is && position) {
      const goal = position.value / run.length;
      s.x = s.presence < 0.3 ? goal : s.x + (goal - s.x) * quick;
      s.spread += ((position.std ?? 0) / run.length - s.spread) * slow;
      s.depth += (this.depth(force ? force.value : 0.3) - s.depth) * slow;
    }
    moment.levels.slice(0, 2).forEach(([rms], k) => {
      const goal = rms === null ? 0 : Math.max(0, 1 + rms / 45);
      s.swing[k] += (goal - s.swing[k]) * slow;
    });
    if (moment.levels.length === 1) s.swing[1] = s.swing[0];
  }

  line(points, colour, width, dash = []) {
    const c = this.context;
    c.beginPath();
    points.forEach(([x, y], k) => (k ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.setLineDash(dash);
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.lineJoin = c.lineCap = "round";
    c.stroke();
    c.setLineDash([]);
  }

  segments(at, tip, now, colour) {
    const { width, rest, shown } = this, bent = shown.presence > 0.02;
    const swing = Math.max(...shown.swing);
    if (!bent) return this.segment(this.pad, rest, width - this.pad, rest, swing, now, 2.1, colour);
    this.segment(this.pad, rest, at, tip, shown.swing[0], now, 3.1, colour);
    this.segment(at, tip, width - this.pad, rest, shown.swing[1], now, 2.3, colour);
  }

  // One segment: the envelope of its swing as a veil, and the string somewhere within it.
  segment(x0, y0, x1, y1, swing, now, turns, colour) {
    const c = this.context, span = x1 - x0, steps = Math.max(Math.round(span / 5), 8);
    const most = Math.min(15, 0.08 * span) * swing;
    const height = (share) => most * Math.sin(Math.PI * share);
    const straight = (share) => y0 + (y1 - y0) * share;
    c.beginPath();
    for (let k = 0; k <= steps; k++) c.lineTo(x0 + span * k / steps, straight(k / steps) - height(k / steps));
    for (let k = steps; k >= 0; k--) c.lineTo(x0 + span * k / steps, straight(k / steps) + height(k / steps));
    c.closePath();
    c.fillStyle = colour.swing;
    c.fill();
    const phase = STILL.matches ? 0 : Math.sin(2 * Math.PI * turns * now / 1000);
    const points = [];
    for (let k = 0; k <= steps; k++) points.push([x0 + span * k / steps, straight(k / steps) + 0.8 * phase * height(k / steps)]);
    this.line(points, colour.string, 2.2);
  }

  ends(run, colour) {
    const { context: c, width, rest } = this;
    c.fillStyle = colour.string;
    for (const x of [this.pad, width - this.pad]) {
      c.beginPath();
      c.roundRect(x - 4, rest - 13, 8, 26, 3);
      c.fill();
    }
    this.text(run.ends[0], this.pad - 4, rest - 22, colour.muted, "left");
    this.text(run.ends[1], width - this.pad + 4, rest - 22, colour.muted, "right");
  }

  // Where the sensor tells places, where that is known: a band behind the string, its ends in mm.
  range(run, colour) {
    if (!this.band) return;
    const { context: c } = this, y = this.height - 32, [low, high] = run.range, [left, right] = this.band.ends;
    c.fillStyle = colour.range;
    c.fillRect(left, 0, right - left, y);
    for (const x of [left, right]) this.line([[x, 0], [x, y]], colour.muted, 1, [2, 4]);
    const words = [low, high].map((end) => `${millimetres(end)} mm`), [first, last] = words.map((each) => this.wide(each));
    const within = right - left > first + last + 24; // else beside it
    this.text(words[0], within ? left + 6 : Math.max(left - 6 - first, 0), y - 7, colour.ink, "left");
    this.text(words[1], within ? right - 6 : Math.min(right + 6 + last, this.width), y - 7, colour.ink, "right");
    if (right - left > 260) this.text("sensing range", (left + right) / 2, y - 7, colour.muted, "center");
  }

  // Draw on the band alone, in its own colour.
  overBand(draw) {
    const { context: c, height, band: { ends: [left, right], paper } } = this;
    c.save();
    c.beginPath();
    c.rect(left, 0, right - left, height - 32);
    c.clip();
    c.strokeStyle = paper;
    draw();
    c.restore();
  }

  // A driver under the string: a coil that senses, and one that drives.
  drivers(run, colour) {
    const c = this.context, y = this.rest + 24;
    for (const places of run?.drivers ?? []) {
      const [left, right] = places.map((place) => this.pixel(place, run.length)).sort((a, b) => a - b);
      c.beginPath();
      c.roundRect(left - 7, y - 7, right - left + 14, 14, 7);
      c.fillStyle = colour.surface;
      c.fill();
      c.strokeStyle = c.fillStyle = colour.muted;
      c.lineWidth = 1.5;
      c.stroke();
      for (const x of [left, right]) {
        c.beginPath();
        c.arc(x, y, 2.6, 0, 2 * Math.PI);
        c.fill();
      }
    }
  }

  // A touch whose place is not told is said, and drawn nowhere.
  unplaced(colour) {
    this.context.globalAlpha = this.shown.withheld;
    const lines = this.wide(this.withheld, 600) < this.width - 8 ? [this.withheld] : this.withheld.split("; ");
    lines.forEach((line, k) => this.text(line, this.width / 2, (lines.length > 1 ? 16 : 24) + 17 * k, colour.estimate, "center", 600));
    this.context.globalAlpha = 1;
  }

  spread(run, at, colour) {
    const { context: c, height, shown } = this;
    const reach = Math.max(2 * shown.spread * (this.width - 2 * this.pad), 2);
    c.globalAlpha = shown.presence;
    c.fillStyle = colour.spread;
    c.beginPath();
    c.roundRect(at - reach, 30, 2 * reach, height - 92, Math.min(reach, 8));
    c.fill();
    c.globalAlpha = 1;
  }

  touch(at, tip, colour) {
    const { context: c, shown } = this;
    c.globalAlpha = shown.presence;
    const top = Math.max(tip - 62, 30);
    this.line([[at, top], [at, tip - 16]], colour.estimate, 2);
    c.fillStyle = colour.estimate;
    c.beginPath();
    c.arc(at, tip - 11, 10, 0, 2 * Math.PI);
    c.fill();
    c.globalAlpha = 1;
  }

  // Where it slides, the way that it came fades out behind it, and its direction is said.
  slip(moment, at, tip, now, colour) {
    const c = this.context, slides = touched(moment) && decision(moment, "slip");
    if (slides) this.trail.push([at, tip - 11, now]);
    this.trail = this.trail.filter(([, , then]) => now - then < 700);
    for (const [x, y, then] of this.trail) {
      const age = (now - then) / 700;
      c.globalAlpha = 0.35 * (1 - age);
      c.fillStyle = colour.estimate;
      c.beginPath();
      c.arc(x, y, 10 * (1 - 0.6 * age), 0, 2 * Math.PI);
      c.fill();
    }
    c.globalAlpha = 1;
    if (!slides) return;
    const first = this.trail[0];
    const moved = at - first[0];
    const words = Math.abs(moved) < 3 ? "slips" : moved > 0 ? "slides →" : "← slides";
    const half = 0.5 * this.wide(words, 600), x = Math.min(Math.max(at, half), this.width - half);
    this.text(words, x, Math.min(Math.max(tip - 72, 22), this.rest - 40), colour.estimate, "center", 600); // above the pickups' names
  }

  truth(run, moment, colour) {
    const { context: c, rest, height } = this, { contact, position, force } = moment.truth;
    if (!contact || position === undefined || position === null) return;
    const x = this.pixel(position, run.length), y = height - 62, bent = this.shown.depth * this.shown.presence;
    this.line([[x, Math.min(rest + bent + 5, y - 8)], [x, y - 8]], colour.truth, 1.5, [3, 4]);
    c.beginPath();
    c.moveTo(x, y - 7); c.lineTo(x + 7, y); c.lineTo(x, y + 7); c.lineTo(x - 7, y);
    c.closePath();
    c.strokeStyle = colour.truth;
    c.lineWidth = 2;
    c.stroke();
    const words = `${(1e3 * position).toFixed(1)} mm` + (force !== undefined ? `, ${force.toFixed(2)} N` : "");
    const left = x > this.width - 130;
    this.text(words, left ? x - 13 : x + 13, y + 4, colour.truth, left ? "right" : "left");
  }

  ring(run, colour) {
    const c = this.context, x = this.pixel(this.hand.position, run.length), y = this.rest + this.depth(this.hand.force) - 11;
    c.beginPath();
    c.arc(x, y, 19, 0, 2 * Math.PI);
    c.setLineDash([5, 4]);
    c.strokeStyle = colour.hand;
    c.lineWidth = 2;
    c.stroke();
    c.setLineDash([]);
    const left = x > this.width - 80, side = left ? -1 : 1, below = y + 26 < this.height - 74; // else the truth is there
    const words = `${this.hand.force.toFixed(1)} N${this.hand.across ? " ↕" : ""}`;
    this.text(words, x + side * (below ? 17 : 26), y + (below ? 26 : 4), colour.hand, left ? "right" : "left", 600);
  }

  ruler(run, colour) {
    const y = this.height - 32, { width } = this;
    this.line([[this.pad, y], [width - this.pad, y]], colour.line, 1);
    if (!run) return;
    const whole = 1e3 * run.length;
    const label = this.wide(`${whole.toFixed(0)} mm`) + 4;
    const step = [5, 10, 20, 25, 50, 100, 200, 500].find((s) => (width - 2 * this.pad) * s / whole > label) ?? 1000;
    for (let mm = 0; mm <= whole + 1e-6; mm += step) {
      const x = this.pixel(mm / 1e3, run.length);
      this.line([[x, y], [x, y + 6]], colour.line, 1);
      const last = mm > 0 && mm + step > whole + 1e-6;
      this.text(last ? `${mm} mm` : `${mm}`, last ? Math.min(x + 16, width - 2) : x, y + 20, colour.muted, last ? "right" : "center");
    }
  }

  wide(words, weight = 400) {
    this.context.font = `${weight} 13px system-ui, sans-serif`;
    return this.context.measureText(words).width;
  }

  text(words, x, y, colour, align, weight = 400) {
    const c = this.context;
    c.font = `${weight} 13px system-ui, sans-serif`;
    c.fillStyle = colour;
    c.textAlign = align;
    c.lineWidth = 4;
    c.lineJoin = "round";
    c.strokeStyle = this.paper;
    c.strokeText(words, x, y);
    if (this.band) this.overBand(() => c.strokeText(words, x, y));
    c.fillText(words, x, y);
  }
}
