// Twenty seconds of contact, slip, position and force, with uPlot.
// A row: time, contact, slip (probabilities), position, its standard error, force, its standard error,
// then the truth of contact, slip, position and force, and what is decided of contact and slip, 0 or 1.

import { estimate } from "./state.js";

const SPAN = 20, ROWS = 31 * SPAN;
const CHANCE = [["decided", "estimate"], ["probability", "muted"], ["truth", "truth", true]];
const VALUE = [["estimate", "estimate"], ["truth", "truth", true]];
const PLOTS = [
  { title: "Contact", keys: CHANCE, height: 72, columns: [11, 1, 7], range: () => [-0.12, 1.12] },
  { title: "Slip", keys: CHANCE, height: 72, columns: [12, 2, 8], range: () => [-0.12, 1.12] },
  { title: "Position, mm", keys: VALUE, height: 118, columns: [3, 4, 9], range: (length) => [0, 1e3 * length], scale: 1e3 },
  { title: "Force, N", keys: VALUE, height: 118, columns: [5, 6, 10], range: () => [0, 2.6] },
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
    const decided = (name) => (name in moment.decided ? Number(moment.decided[name]) : null);
    this.rows.push([moment.time, chance("contact"), chance("slip"), ...value("position"), ...value("force"),
      truth("contact"), truth("slip"), truth("position"), truth("force"), decided("contact"), decided("slip")]);
    if (this.rows.length > ROWS) this.rows.splice(0, this.rows.length - ROWS);
    this.changed = true;
  }

  build(colour) {
    this.colour = colour;
    this.plots.forEach((plot) => plot.destroy());
    this.place.replaceChildren();
    this.plots = PLOTS.map((plot) => {
      const head = document.createElement("h3");
      head.append(`${plot.title} `, ...plot.keys.filter(([name]) => name !== "truth" || this.run.simulated).map(([name, tone, dashed]) => {
        const key = document.createElement("span");
        key.className = `key${dashed ? " dashed" : ""}`;
        key.style.setProperty("--key", colour[tone]);
        key.textContent = name;
        return key;
      }));
      const box = document.createElement("div");
      this.place.append(head, box);
      return new window.uPlot(this.options(plot, colour), this.data(plot), box);
    });
  }

  options(plot, colour) {
    const chance = plot.keys === CHANCE, last = plot === PLOTS.at(-1), range = plot.range(this.run.length);
    const line = (stroke, width = 1.8, dash) => ({ stroke, width, dash, points: { show: false }, spanGaps: false });
    const truth = line(colour.truth, 1.5, [5, 4]), steps = { paths: window.uPlot.paths.stepped({ align: 1 }) };
    const series = chance
      ? [{}, { ...line(colour.estimate), ...steps, fill: colour.spread }, line(colour.muted, 1), { ...truth, ...steps }]
      : [{}, line("transparent", 0), line("transparent", 0), line(colour.estimate), truth];
    const font = "12px system-ui, sans-serif", grid = { stroke: colour.line, width: 1 }, ticks = { show: false };
    return {
      width: Math.max(this.place.clientWidth, 200), height: plot.height, series,
      bands: chance ? [] : [{ series: [1, 2], fill: colour.spread }],
      legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: { range: () => range } },
      axes: [
        { stroke: colour.muted, grid: { show: false }, ticks, font, size: 20, gap: 2, show: last,
          values: (_, values) => values.map((v) => (v < 0 ? "" : `${v} s`)) },
        { stroke: colour.muted, grid, ticks, font, size: 42, splits: chance ? [0, 1] : undefined, space: 34,
          values: chance ? () => ["no", "yes"] : undefined },
      ],
      padding: [6, 8, last ? 0 : 6, 0],
    };
  }

  data({ keys, columns, scale = 1 }) {
    const rows = this.rows, column = (n) => rows.map((row) => (row[n] === null ? null : row[n] * scale));
    const time = rows.map((row) => row[0]), [value, std, truth] = columns;
    if (keys === CHANCE) return [time, ...columns.map(column)];
    const bound = (sign) => rows.map((row) => (row[value] === null || row[std] === null ? null : scale * (row[value] + sign * 2 * row[std])));
    return [time, bound(1), bound(-1), column(value), column(truth)];
  }

  draw() {
    if (!this.changed || !this.plots.length) return;
    this.changed = false;
    const last = this.rows.length ? this.rows[this.rows.length - 1][0] : 0;
    this.plots.forEach((plot, k) => {
      plot.batch(() => {
        plot.setData(this.data(PLOTS[k]), false);
        plot.setScale("x", { min: last - SPAN, max: last });
      });
    });
  }

  resize() {
    const width = this.place.clientWidth;
    if (width > 0) this.plots.forEach((plot, k) => plot.setSize({ width, height: PLOTS[k].height }));
  }
}
