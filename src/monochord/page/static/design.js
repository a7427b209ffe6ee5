// The design of a sensor: sliders ask, the server computes, and this file shows what it says.

import { Plot, short } from "./plot.js";
import { colours, themed } from "./theme.js";

const element = (id) => document.getElementById(id);
const PAUSE = 120, SWEEP_PAUSE = 450; // ms without a change until a string, and until a sweep is asked for

// name, label, unit, factor from SI, ends of the slider and its step, in that unit
const STRING = [
  ["gauge", "Gauge", "mm", 1e3, 0.15, 0.6, 0.001],
  ["tension", "Tension", "N", 1, 5, 120, 1],
  ["length", "Length", "mm", 1e3, 100, 700, 1],
];
const TASK = [
  ["range", "Sensing range", "mm", 1e3, 10, 600, 1],
  ["most", "Largest press", "N", 1, 0.2, 10, 0.1],
  ["force_resolution", "Force wanted to", "N", 1, 0.01, 1, 0.01],
  ["resolution", "Position wanted to", "mm", 1e3, 0.05, 5, 0.05],
  ["room", "Room for other strings", "mm", 1e3, 100, 700, 1],
  ["model", "Model that takes it"],
];
const OTHERS = [
  ["least", "Least press", "N", 1, 0.01, 1, 0.01],
  ["gap", "Gap to the poles", "mm", 1e3, 0.2, 5, 0.1],
  ["level", "Drivers' force", "times", 1, 0.05, 8, 0.05],
  ["wire", "Wire"], ["frame", "Frame"], ["mount", "Objects are held"], ["material", "Material that touches"],
  ["contact_share", "Contact's compliance, to", "%", 100, 0, 100, 1],
  ["line_std", "Lines, to", "‰", 1e3, 0.01, 5, 0.01],
  ["end_std", "Ends, to", "mm", 1e3, 0, 1, 0.01],
  ["open_std", "Open pitch, to", "‰", 1e3, 0.01, 5, 0.01],
  ["window", "Window", "ms", 1e3, 10, 500, 10],
];
const NUMBERS = [...STRING, ...TASK, ...OTHERS].filter(([, , unit]) => unit);
const LIMITS = { most: "forces", least: "forces", room: "length" }; // whose limits a field has

class Asker { // one request at a time; of those that come meanwhile, the newest is sent next
  constructor(take) { Object.assign(this, { take, next: null, busy: false }); }

  ask(message) {
    this.next = message;
    if (!this.busy) this.send();
  }

  async send() {
    this.busy = true;
    while (this.next) {
      const body = JSON.stringify(this.next);
      this.next = null;
      let answer = { again: true };
      try {
        while (answer.again && !this.next) answer = await (await fetch("design", { method: "POST", body })).json();
      } catch {
        answer = { error: "The server does not answer. Start it again, then change a wish." };
      }
      if (!this.next) this.take(answer);
    }
    this.busy = false;
    idle();
  }
}

let colour = colours(), about = null, own = null, advice = null, refusals = { string: "", sweep: "" }, timers = {};
const asker = new Asker((answer) => { refuse("string", answer.error); if (!answer.error) showString((own = answer)); });
const sweeper = new Asker((answer) => { refuse("sweep", answer.error); if (!answer.error) showAdvice((advice = answer)); });

function idle() { element("busy").textContent = asker.busy || sweeper.busy || timers.sweep ? "computing …" : ""; }

function refuse(which, line) {
  refusals = { ...refusals, [which]: line ?? "" };
  const lines = [...new Set(Object.values(refusals).filter(Boolean))];
  element("refusal").hidden = !lines.length;
  element("refusal").textContent = lines.join(" ");
  document.querySelector(".results").dataset.stale = String(Boolean(refusals.string));
  element("download").disabled = Boolean(refusals.string) || !own;
}

// The value of a field in SI units. Text that is not a number is sent unchanged: the server refuses it.
function value(name) {
  const { value: text } = element(name), row = NUMBERS.find(([each]) => each === name), number = Number(text);
  if (!row) return text;
  return text.trim() === "" || !Number.isFinite(number) ? text : Number((number / row[3]).toPrecision(12));
}

function wishes() {
  const names = Object.keys(about.wishes).filter((name) => !["length", "forces"].includes(name));
  return { ...Object.fromEntries(names.map((name) => [name, value(name)])), forces: [value("least"), value("most")] };
}

function changed(name, soon = false) {
  location.replace(`#${new URLSearchParams(fields().map((each) => [each, element(each).value]))}`);
  clearTimeout(timers.string);
  timers.string = setTimeout(() => {
    asker.ask({ do: "string", wishes: { ...wishes(), gauge: value("gauge"), tension: value("tension"), length: value("length") } });
    idle();
  }, soon ? 0 : PAUSE);
  if (STRING.some(([each]) => each === name)) return;
  clearTimeout(timers.sweep);
  timers.sweep = setTimeout(() => {
    timers.sweep = null;
    sweeper.ask({ do: "recommend", wishes: { ...wishes(), length: value("room") } });
    idle();
  }, soon ? 0 : SWEEP_PAUSE);
  idle();
}

function fields() { return [...STRING, ...TASK, ...OTHERS].map(([name]) => name); }

function build(place, rows) {
  for (const [name, label, unit, factor, low, high, step] of rows) {
    const row = document.createElement("div"), title = document.createElement("label");
    title.htmlFor = name;
    title.textContent = label;
    row.className = "slider";
    row.append(title);
    if (!unit) {
      const select = Object.assign(document.createElement("select"), { id: name });
      select.append(...about.choices[name].map((each) => new Option(each.replaceAll("_", " "), each)));
      select.addEventListener("change", () => changed(name));
      row.append(select);
    } else {
      const [least, most] = about.limits[LIMITS[name] ?? name].map((end) => Number((end * factor).toPrecision(6)));
      const slider = Object.assign(document.createElement("input"), { type: "range", id: `${name}-slider`, min: low, max: high, step });
      const number = Object.assign(document.createElement("input"), { type: "number", id: name, min: least, max: most, step: "any", required: true });
      const after = document.createElement("span");
      after.textContent = unit;
      slider.setAttribute("aria-label", `${label}, ${unit}`);
      slider.addEventListener("input", () => { number.value = slider.value; changed(name); });
      number.addEventListener("input", () => { slider.value = number.value; changed(name); });
      row.append(slider, number, after);
    }
    element(place).append(row);
  }
}

function set(name, text) {
  element(name).value = text;
  const slider = element(`${name}-slider`);
  if (slider) slider.value = text;
}

function setSI(name, number) {
  const row = NUMBERS.find(([each]) => each === name);
  set(name, row ? String(Number((number * row[3]).toPrecision(6))) : number);
}

function facts(id, rows) {
  element(id).replaceChildren(...rows.map(([name, text, warns]) => {
    const row = document.createElement("div"), term = document.createElement("dt"), shown = document.createElement("dd");
    term.textContent = name;
    shown.textContent = text;
    if (warns) shown.className = "warns";
    row.append(term, shown);
    return row;
  }));
}

const mm = (metres) => `${short(1e3 * metres)} mm`, percent = (share) => `${Math.round(100 * share)} %`;
const signed = (number, digits) => `${number < 0 ? "−" : "+"}${Math.abs(number).toFixed(digits)}`;

// Says in a line what a string lacks, and marks whether that is nothing.
function judge(id, before, { lacks, fits_model }) {
  const lines = [lacks.length ? `It lacks: ${lacks.join("; ")}.` : "It meets every wish.", ...(fits_model === false ? [`The model ${value("model")} refuses it.`] : [])];
  element(id).textContent = `${before}${lines.join(" ")}`;
  return lacks.length || fits_model === false ? "warns" : "good";
}

function showString(one) {
  const { lacks } = one, warns = (word) => lacks.some((each) => each.startsWith(word)), usual = `${short(one.usual)} N`;
  element("figures-title").textContent = `This string: ${one.title}`;
  element("verdict").className = judge("verdict", "", one);
  const most = value("most");
  facts("figures", [
    ...(one.fits_model === null ? [] : [["Model", `${value("model")} ${one.fits_model ? "takes" : "refuses"} it`, !one.fits_model]]),
    ["Open pitch", `${Math.round(one.frequency)} Hz`, warns("open")],
    ["Lines", `${Math.round(one.lowest)} to ${Math.round(one.highest)} Hz`, warns("lines")],
    [`Force of ${usual}, to`, `${short(one.force_std)} N`, warns("force")],
    [`Force of ${most} N, to`, `${short(one.force_std_most)} N`],
    ["Position, to", mm(one.position_std), warns("position")],
    ["Sensitivity", `${short(one.cents_per_newton)} cents/N`],
    ["Settles in", `${Math.round(1e3 * one.settling)} ms`],
    ["Follows up to", `${short(one.bandwidth)} Hz`],
    ["Stress", `${Math.round(one.stress / 1e6)} MPa, ${percent(one.stress_share)} of the strength`, warns("stress")],
    ["Clearance needed", `${mm(one.clearance)}: it ${one.squeal} at ${element("gap").value} mm`, warns("clearance")],
    ["Swing and sag", `${mm(one.swing)} and ${mm(one.sag)}`],
    ["Drift", `${signed(one.drift, 2)} cents/K, reads as ${signed(one.drift_force, 2)} N/K`],
    ["Ambiguous pairs of modes", percent(one.ambiguity.share)],
    ["Ambiguous fundamentals", `at ${percent(one.ambiguity.fundamental)} of the places`],
  ]);
  draw();
  const widest = (rows) => Math.max(...rows.map(([, , size]) => Math.abs(size)), 1e-12);
  const frames = Object.entries(one.frames).map(([name, { cents, force }]) => [name, [signed(cents, 2), signed(force, 2)], cents]);
  table("frames", frames, widest(frames));
  const mounts = Object.entries(one.mounts).map(([name, force]) => [name, [short(force)], force]);
  table("mounts", mounts, widest(mounts));
}

function table(id, rows, widest) {
  element(id).replaceChildren(...rows.map(([name, cells, size]) => {
    const row = document.createElement("tr"), head = document.createElement("th"), last = document.createElement("td");
    const bar = Object.assign(document.createElement("meter"), { min: 0, max: widest, value: Math.abs(size) });
    bar.setAttribute("aria-hidden", "true");
    head.scope = "row";
    head.textContent = name.replaceAll("_", " ");
    last.append(bar);
    row.append(head, ...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })), last);
    return row;
  }));
}

function showAdvice(one) {
  const { title, reasons } = one;
  judge("advice", `${title}. `, one);
  element("reasons").replaceChildren(...reasons.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  element("take").disabled = false;
  draw();
}

const along = { label: "position", unit: "mm" };
const plots = {
  lines: new Plot(element("charts"), { title: "Fundamental of each segment", unit: "Hz", across: along }),
  force: new Plot(element("charts"), { title: "Force, standard error", unit: "N", across: along, log: true }),
  position: new Plot(element("charts"), { title: "Position, standard error", unit: "mm", across: along, log: true }),
  pairs: new Plot(element("charts"), { title: "Pairs of modes that fit another place too", unit: "%", across: along, top: 100 }),
  others: new Plot(element("charts"), { title: "Speed and force", unit: "N", across: { label: "a touch settles in", unit: "ms" }, log: true, height: 230 }),
};

function draw() {
  if (own) {
    const { positions, forces, lines, position_std, force_std } = own.curves, x = positions.map((each) => 1e3 * each);
    const by = (rows, scale) => rows.map((values, k) => ({ name: `${short(forces[k])} N`, values: values.map((each) => (each === null ? null : scale * each)) }));
    plots.lines.show(x, [0, 1].map((side) => ({ name: `segment ${side + 1}`, values: lines.map((each) => each[side]) })), colour);
    plots.force.show(x, by(force_std, 1), colour, { name: "wanted", value: value("force_resolution") });
    plots.position.show(x, by(position_std, 1e3), colour, { name: "wanted", value: 1e3 * value("resolution") });
    plots.pairs.show(own.ambiguity.positions.map((each) => 1e3 * each), [{ name: "share of pairs", values: own.ambiguity.shares.map((each) => 100 * each) }], colour);
  }
  if (!advice) return;
  // All strings of the sweep in the order of settling, each in the row of its kind.
  const rows = [...advice.sweep.map(([time, force, meets]) => [time, force, meets ? 1 : 0]),
    ...advice.pareto.map(([time, force]) => [time, force, 2]), [advice.settling, advice.force_std, 3],
    ...(own ? [[own.settling, own.force_std, 4]] : [])].sort((a, b) => a[0] - b[0]);
  const kind = (k, more) => ({ values: rows.map(([, force, of]) => (of === k ? force : null)), ...more });
  plots.others.show(rows.map(([time]) => 1e3 * time), [
    kind(0, { name: "lacks a wish", tone: "muted", points: 3 }), kind(1, { name: "meets every wish", tone: "estimate", points: 6 }),
    kind(2, { name: "best of those that hold", tone: "ink" }), kind(3, { name: "recommended", tone: "truth", points: 12 }),
    kind(4, { name: "this string", tone: "hand", points: 12 }),
  ], colour);
}

function download() {
  const link = document.createElement("a"), file = new Blob([own.toml], { type: "application/toml" });
  link.href = URL.createObjectURL(file);
  link.download = "sensor.toml";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

themed(() => { colour = colours(); draw(); });
element("wishes").addEventListener("submit", (event) => event.preventDefault());
element("download").addEventListener("click", download);
element("take").addEventListener("click", () => {
  for (const [name, number] of Object.entries(advice.string)) setSI(name, number);
  changed("gauge", true);
  element("figures-title").focus();
});

new Asker((answer) => {
  refuse("about", answer.error);
  if (answer.error) return;
  about = answer;
  build("own", STRING);
  build("task", TASK);
  build("others", OTHERS);
  const { forces, length, ...rest } = about.wishes;
  for (const [name, usual] of Object.entries({ ...about.string, ...rest, least: forces[0], most: forces[1], room: length })) setSI(name, usual);
  for (const [name, text] of new URLSearchParams(location.hash.slice(1))) if (fields().includes(name)) set(name, text);
  changed("room", true);
}).ask({ do: "about" });

// What a test or a curious person may ask of the page in the console.
window.monochord = { get own() { return own; }, get advice() { return advice; }, get busy() { return asker.busy || sweeper.busy; }, plots };
