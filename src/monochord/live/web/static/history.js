// Twenty seconds of contact, slip, position and force, with uPlot.
// A row: time, contact, slip (probabilities), position, its standard error, force, its standard error,
// then the truth of contact, slip, position and force, and what is decided of contact and slip, 0 or 1.

import { estimate } from "./state.js";

const SPAN = 20, ROWS = 31 * SPAN;
const ERRORS = 2; // standard errors to each side that the band shows, as on the drawn string
const CHANCE = [["decided", "estimate"], ["probability", "muted"], ["truth", "truth", true]];
const VALUE = [["estimate", "estimate"], ["two standard errors", "spread", false, true], ["truth", "truth", true]];
const PLACE = [...VALUE, ["sensing range", "range", false, true]];
const PLOTS = [
  { title: "Contact", keys: CHANCE, height: 72, columns: [11, 1, 7], range: () => [-0.12, 1.12] },
  { title: "Slip", keys: CHANCE, height: 72, columns: [12, 2, 8], range: () => [-0.12, 1.12] },
  { title: "Position, mm", keys: PLACE, height: 168, columns: [3, 4, 9], range: places, scale: 1e3 },
  { title: "Force, N", keys: VALUE, height: 118, columns: [5, 6, 10], range: forces },
];

// The axis of position: where it was, 20 mm at least; the sensing range, or the string, while it was nowhere.
function places(was, { range, length }) {
  if (!was) return (range ?? [0, length]).map((end) => 1e3 * end);
  const half = Math.max(0, 10 - (was[1] - was[0]) / 2), step = 5;
  const low = Math.max(0, Math.floor((was[0] - half) / step) * step);
  return [low, Math.ceil((was[1] + half) / step) * step];
}

function forces(was) { return [0, Math.max(2.5, Math.ceil(was?.[1] ?? 0))]; }

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
      head.append(`${plot.title} `, ...plot.keys.filter(([name]) => this.shows(name)).map(([name, tone, dashed, band]) => {
        const key = document.createElement("span");
        key.className = `key${dashed ? " dashed" : ""}${band ? " band" : ""}`;
        key.style.setProperty("--key", colour[tone]);
        key.textContent = name;
        return key;
      }));
      const box = document.createElement("div");
      this.place.append(head, box);
      return new window.uPlot(this.options(plot, colour), this.data(plot), box);
    });
  }

  shows(name) { return { truth: this.run.simulated, "sensing range": this.run.range }[name] ?? true; }

  options(plot, colour) {
    const chance = plot.keys === CHANCE, last = plot === PLOTS.at(-1);
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
      scales: { x: { time: false }, y: { range: (of) => plot.range(chance ? null : extent(of.data), this.run) } },
      axes: [
        { stroke: colour.muted, grid: { show: false }, ticks, font, size: 20, gap: 2, show: last,
          values: (_, values) => values.map((v) => (v < 0 ? "" : `${v} s`)) },
        { stroke: colour.muted, grid, ticks, font, size: 42, splits: chance ? [0, 1] : undefined, space: 28,
          values: chance ? () => ["no", "yes"] : undefined },
      ],
      padding: [6, 14, last ? 0 : 6, 0],
      hooks: plot.range === places && this.run.range ? { drawClear: [(of) => this.shade(of, colour)] } : {},
    };
  }

  // The sensing range behind the lines, as behind the drawn string.
  shade(of, colour) {
    const { left, top, width, height } = of.bbox;
    const [low, high] = this.run.range.map((end) => Math.min(Math.max(of.valToPos(1e3 * end, "y", true), top), top + height));
    of.ctx.fillStyle = colour.range;
    of.ctx.fillRect(left, high, width, low - high);
  }

  data({ keys, columns, scale = 1 }) {
    const rows = this.rows, column = (n) => rows.map((row) => (row[n] === null ? null : row[n] * scale));
    const time = rows.map((row) => row[0]), [value, std, truth] = columns;
    if (keys === CHANCE) return [time, ...columns.map(column)];
    const bound = (sign) => rows.map((row) => (row[value] === null || row[std] === null ? null : scale * (row[value] + sign * ERRORS * row[std])));
    return [time, bound(1), bound(-1), column(value), column(truth)];
  }

  draw() {
    if (!this.changed || !this.plots.length) return;
    this.changed = false;
    if (this.plots[0].width !== this.place.clientWidth) this.resize(); // they may have been built while folded
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

// Where a quantity was, estimate and truth, with room for nine tenths of the bands; null where it was nowhere.
function extent([time, upper, , value, truth]) {
  const from = Math.max(time.findIndex((each) => each >= time[time.length - 1] - SPAN), 0);
  const shown = [...value.slice(from), ...truth.slice(from)].filter((each) => each !== null);
  if (!shown.length) return null;
  const bands = upper.map((each, k) => (each === null ? null : each - value[k])).slice(from).filter((each) => each !== null);
  const room = bands.sort((a, b) => a - b)[Math.floor(0.9 * (bands.length - 1))] ?? 0;
  return [Math.min(...shown) - room, Math.max(...shown) + room];
}
