// A chart with a title, a key, a line of what the cursor points at, and a sentence for a screen reader.

const DASHES = [undefined, [7, 4], [2, 3]]; // beside the colour, so that lines differ without it
const TONES = ["estimate", "truth", "hand"];

export class Plot {
  // `about`: {title, unit, across: {label, unit}, log, height}
  constructor(place, about) {
    this.about = about;
    this.head = document.createElement("h3");
    this.at = document.createElement("p");
    this.at.className = "at";
    this.box = document.createElement("div");
    this.box.setAttribute("role", "img");
    this.part = document.createElement("div");
    this.part.append(this.head, this.box, this.at);
    place.append(this.part);
    new ResizeObserver(() => this.resize()).observe(this.box);
  }

  // `lines`: [{name, values, tone, points, dash}]; all have the same `x`. `level`: {name, value}, a dashed line across.
  show(x, lines, colour, level = null) {
    this.plot?.destroy();
    this.x = x;
    this.lines = lines.map((each, k) => ({ tone: TONES[k % TONES.length], dash: DASHES[k % DASHES.length], ...each }));
    if (level) this.lines.push({ name: level.name, values: x.map(() => level.value), tone: "muted", dash: [4, 4], thin: true });
    this.head.replaceChildren(`${this.about.title} `, ...this.lines.map((each) => key(each, colour)));
    this.box.setAttribute("aria-label", `${this.about.title}. ${this.lines.map((each) => this.told(each)).join(". ")}`);
    this.at.textContent = "\u00a0";
    this.plot = new window.uPlot(this.options(colour), [x, ...this.lines.map(({ values }) => values)], this.box);
  }

  told({ name, values }) {
    const finite = values.filter((each) => each !== null);
    if (!finite.length) return `${name}: none`;
    const [low, high] = [Math.min(...finite), Math.max(...finite)].map(short), { unit } = this.about;
    return low === high ? `${name}: ${low} ${unit}` : `${name}: ${low} to ${high} ${unit}`;
  }

  options(colour) {
    const { log, unit, across, height = 190, top } = this.about, font = "12px system-ui, sans-serif";
    const axis = { stroke: colour.muted, grid: { stroke: colour.line, width: 1 }, ticks: { show: false }, font };
    const values = (_, splits) => splits.map((v) => (v === null ? "" : short(v)));
    return {
      width: Math.max(this.box.clientWidth, 200), height, legend: { show: false },
      cursor: { y: false, drag: { x: false, y: false }, points: { size: 6 } },
      scales: { x: { time: false }, y: log ? { distr: 3 } : { range: (_, low, high) => [Math.min(0, low), top ?? (high > 0 ? 1.1 * high : 1)] } },
      series: [{}, ...this.lines.map(({ tone, dash, points, thin }) => ({
        stroke: points ? "transparent" : colour[tone], width: points ? 0 : thin ? 1.2 : 1.8, dash, spanGaps: !points,
        points: points ? { show: true, size: points, fill: colour[tone], stroke: colour[tone], width: 0 } : { show: false },
      }))],
      axes: [
        { ...axis, grid: { show: false }, size: 22, gap: 2, label: `${across.label}, ${across.unit}`, labelSize: 17, labelFont: font, values },
        { ...axis, size: 50, space: 26, label: unit, labelSize: 16, labelFont: font, labelGap: 0, values },
      ],
      padding: [8, 12, 0, 0],
      hooks: { setCursor: [({ cursor: { idx } }) => this.point(idx)] },
    };
  }

  point(k) {
    const { across, unit } = this.about;
    const some = k === null || k === undefined ? [] : this.lines.filter(({ values, thin }) => !thin && values[k] !== null);
    const text = some.map(({ name, values }) => `${name} ${short(values[k])} ${unit}`).join(", ");
    this.at.textContent = text ? `${short(this.x[k])} ${across.unit}: ${text}` : "\u00a0";
  }

  resize() {
    if (this.plot && this.box.clientWidth > 0) this.plot.setSize({ width: this.box.clientWidth, height: this.about.height ?? 190 });
  }
}

function key({ name, tone, dash, points }, colour) {
  const each = document.createElement("span");
  each.className = `key${points ? " dot" : dash ? " dashed" : ""}`;
  each.style.setProperty("--key", colour[tone]);
  each.textContent = name;
  return each;
}

// A number in three digits, without an exponent where people need none.
export function short(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1000) return Math.round(value).toLocaleString("en-US");
  return size < 1e-4 ? value.toExponential(1) : String(Number(value.toPrecision(3)));
}
