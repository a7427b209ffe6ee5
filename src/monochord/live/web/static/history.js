// Twenty seconds of contact, slip, position and force, with uPlot.
// A row: time, contact, slip (probabilities), position, its standard error, force, its standard error,
// then the truth of contact, slip, position and force.

import { estimate } from "./state.js";

const SPAN = 20, ROWS = 31 * SPAN, HEIGHT = 118;

const AXES = [
  { title: "Contact and slip, probability", keys: [["contact", "estimate"], ["slip", "hand", true]], range: [-0.05, 1.05], ticks: (v) => `${v}`, splits: [0, 0.5, 1] },
  { title: "Position, mm", keys: [["estimate", "estimate"], ["truth", "truth", true]] },
  { title: "Force, N", keys: [["estimate", "estimate"], ["truth", "truth", true]] },
];

export class History {
  constructor(place) {
    this.place = place;
    this.rows = [];
    this.plots = [];
    this.changed = false;
    new ResizeObserver(() => this.resize()).observe(place);
  }

  reset(run, colour) {
    this.run = run;
    this.rows = run.history;
    this.build(colour);
  }

  add(moment) {
    const value = (name) => { const each = estimate(moment, name); return each ? [each.value, each.std] : [null, null]; };
    const chance = (name) => moment.window[name]?.value ?? null, truth = (name) => moment.truth[name] ?? null;
    this.rows.push([moment.time, chance("contact"), chance("slip"), ...value("position"), ...value("force"),
      truth("contact"), truth("slip"), truth("position"), truth("force")]);
    if (this.rows.length > ROWS) this.rows.splice(0, this.rows.length - ROWS);
    this.changed = true;
  }

  build(colour) {
    this.colour = colour;
    this.plots.forEach((plot) => plot.destroy());
    this.place.replaceChildren();
    const whole = 1e3 * this.run.length;
    const ranges = [[-0.08, 1.08], [0, whole], [0, 2.6]];
    this.plots = AXES.map((axis, k) => {
      const head = document.createElement("h3");
      head.append(`${axis.title} `, ...axis.keys.filter(([name]) => name !== "truth" || this.run.simulated).map(([name, tone, dashed]) => {
        const key = document.createElement("span");
        key.className = `key${dashed ? " dashed" : ""}`;
        key.style.setProperty("--key", colour[tone]);
        key.textContent = name;
        return key;
      }));
      const box = document.createElement("div");
      this.place.append(head, box);
      return new window.uPlot(this.options(k, ranges[k], colour), this.data(k), box);
    });
  }

  options(k, range, colour) {
    const series = [{}];
    const line = (stroke, width = 1.8, dash) => ({ stroke, width, dash, points: { show: false }, spanGaps: false });
    if (k === 0) series.push(line(colour.estimate), line(colour.hand, 1.8, [6, 3]));
    else series.push(line("transparent", 0), line("transparent", 0), line(colour.estimate), line(colour.truth, 1.5, [5, 4]));
    const font = "12px system-ui, sans-serif", grid = { stroke: colour.line, width: 1 }, ticks = { show: false };
    return {
      width: Math.max(this.place.clientWidth, 200), height: HEIGHT, series,
      bands: k === 0 ? [] : [{ series: [1, 2], fill: colour.spread }],
      legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: { range: () => range } },
      axes: [
        { stroke: colour.muted, grid: { show: false }, ticks, font, size: 20, gap: 2, show: k === 2,
          values: (_, values) => values.map((v) => (v < 0 ? "" : `${v} s`)) },
        { stroke: colour.muted, grid, ticks, font, size: 42, splits: k === 0 ? [0, 0.5, 1] : undefined, space: 34 },
      ],
      padding: [6, 8, k === 2 ? 0 : 6, 0],
    };
  }

  data(k) {
    const rows = this.rows, column = (n, scale = 1) => rows.map((row) => (row[n] === null ? null : row[n] * scale));
    const time = column(0);
    if (k === 0) return [time, column(1), column(2)];
    const [value, std, truth, scale] = k === 1 ? [3, 4, 9, 1e3] : [5, 6, 10, 1];
    const bound = (sign) => rows.map((row) => (row[value] === null || row[std] === null ? null : scale * (row[value] + sign * 2 * row[std])));
    return [time, bound(1), bound(-1), column(value, scale), column(truth, scale)];
  }

  draw() {
    if (!this.changed || !this.plots.length) return;
    this.changed = false;
    const last = this.rows.length ? this.rows[this.rows.length - 1][0] : 0;
    this.plots.forEach((plot, k) => {
      plot.batch(() => {
        plot.setData(this.data(k), false);
        plot.setScale("x", { min: last - SPAN, max: last });
      });
    });
  }

  resize() {
    const width = this.place.clientWidth;
    if (width > 0) this.plots.forEach((plot) => plot.setSize({ width, height: HEIGHT }));
  }
}
