// The page: messages come in at their pace, and everything is drawn once a frame.

import { History } from "./history.js";
import { facts, showEvents, showNotes, showNumbers, showPitch, showStream, speak } from "./numbers.js";
import { Spectra } from "./spectrum.js";
import { brief, explain, explainRun, foldSections } from "./sections.js";
import { Run, span } from "./state.js";
import { StringView } from "./string.js";
import { Strings } from "./strings.js";
import { Tasks } from "./tasks.js";
import { colours, themed } from "./theme.js";
import { Hand, showSettings } from "./touch.js";

const element = (id) => document.getElementById(id);
foldSections();
explain();
const view = new StringView(element("string"));
const spectra = new Spectra(element("spectra"));
const history_ = new History(element("history"));
let run = null, moment = null, fresh = false, colour = colours(), timing = null;
let before = 0, pace = 16, historyDue = 0, spectraDue = 0, spectraDrawn = 0, unseenDue = 0; // ms; pace: from frame to frame, averaged
// Animation frames; moments that came, that were shown, and that a newer one replaced before the next frame.
const counts = { frames: 0, received: 0, drawn: 0, replaced: 0 };

// What is not on the screen is drawn once in UNSEEN ms, for a capture of the whole page.
const visible = new Set(), UNSEEN = 1000;
const watch = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
  if (isIntersecting) visible.add(target.id);
  else visible.delete(target.id);
}));
for (const id of ["string", "spectra", "history"]) watch.observe(element(id));

const connection = new Run({
  lost() { hand.lift(); },
  hello(message) {
    run = message;
    moment = null; // the one before may be of another string
    fresh = false;
    element("waiting").hidden = true;
    simulated(message.simulated);
    showSensor(run);
    hand.allow(run);
    tasks.allow(run);
    element("controls").hidden = element("hint").hidden = element("legend-hand").hidden = !run.controls;
    if (run.controls) showSettings(run.controls.settings, send);
    spectra.reset(run);
    history_.reset(run, colour);
    showEvents(run.events);
  },
  moment(message) {
    if (fresh) counts.replaced += 1;
    moment = message;
    fresh = true;
    counts.received += 1;
    if (run && message.simulated && !run.simulated) simulated(true);
    if (message.timing) timing = message.timing;
    history_.add(message);
  },
  spectrum(message) { spectra.take(message); },
});

// A touch that cannot be sent is seen: the string does not bend. Of anything else the page says it.
function send(message) {
  const sent = connection.send(message);
  if (!sent && message.do !== "touch" && message.do !== "release") tasks.say("Not done: the page is not connected. Try again once it is.");
  return sent;
}
const hand = new Hand(view, send), tasks = new Tasks(send);
const strings = new Strings(element("strings"), (name) => send({ do: "show", string: name }));

// What is known of the sensor: nothing is said of one that is not.
function showSensor({ range, drivers }) {
  element("legend-range").hidden = !range;
  element("legend-drivers").hidden = !drivers.length;
  element("where").textContent = range ? `Position is estimated from ${span(range)}, elsewhere only contact.` : "";
}

function simulated(is) {
  if (run) explainRun(Object.assign(run, { simulated: is }));
  document.body.dataset.simulated = String(is);
  element("simulated").hidden = element("legend-truth").hidden = !is;
  if (is && history_.plots.length) history_.build(colour);
}

function frame(now) {
  pace += 0.05 * (Math.min(now - before, 100) - pace);
  before = now;
  counts.frames += 1;
  hand.tell(now);
  if (run) {
    const all = now > unseenDue;
    if (all) unseenDue = now + UNSEEN;
    const shows = (id) => visible.has(id) || (all && element(id).clientWidth > 0); // not where it is folded
    if (shows("string")) view.draw(run, moment, now, colour);
    if ((all || now > spectraDue) && shows("spectra")) { // where frames take long, the string goes first
      drawSpectra(now);
      spectraDue = now + 4 * (pace - 18);
    }
    if (fresh && moment) {
      fresh = false;
      counts.drawn += 1;
      showNumbers(moment);
      showPitch(moment);
      showNotes(moment);
      showEvents(moment.events);
      showStream(moment);
      element("tasks").hidden = !moment.tasks;
      if (moment.tasks) tasks.show(moment);
      strings.show(moment.strings, moment.string);
      spectra.levels(moment);
      speak(moment);
      if (moment.settings) showSettings(moment.settings, send);
      if (!view.canvas.classList.contains("touchable")) view.canvas.setAttribute("aria-label", `The string: ${element("spoken").textContent}`);
    }
    if ((all || now > historyDue) && shows("history")) {
      historyDue = now + Math.max(60, 8 * (pace - 10));
      history_.draw();
    }
    if (timing) {
      latency(timing);
      timing = null;
    }
  }
  requestAnimationFrame(frame);
}

function drawSpectra(now) {
  spectra.draw(moment, (now - spectraDrawn) / 1000, colour);
  spectraDrawn = now;
}

// On paper all is as new as the numbers.
addEventListener("beforeprint", () => {
  if (!run) return;
  const now = performance.now();
  view.draw(run, moment, now, colour);
  drawSpectra(now);
  history_.draw();
});

function latency(latencies) {
  const canvas = element("latency"), c = canvas.getContext("2d"), ratio = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight, base = height - 22;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  const most = Math.max(...latencies.counts, 1), bar = width / latencies.counts.length;
  const edge = (k) => latencies.edges[Math.min(Math.max(k, 0), latencies.edges.length - 1)];
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  latencies.counts.forEach((count, k) => {
    const tall = count ? Math.max(2, (base - 8) * Math.sqrt(count / most)) : 0;
    c.fillStyle = colour.estimate;
    c.beginPath();
    c.roundRect(k * bar + 1, base - tall, Math.max(bar - 2, 1), tall, [3, 3, 0, 0]);
    c.fill();
  });
  c.fillStyle = colour.muted;
  c.fillRect(0, base, width, 1);
  latencies.edges.forEach((value, k) => {
    if (k % 8 === 0) c.fillText(`${edge(k)} ms`, Math.min(Math.max((k + 1) * bar, 22), width - 26), base + 15);
  });
  const ms = (value) => (value === null ? "–" : `${value.toFixed(2)} ms`);
  brief("latency", `median ${ms(latencies.p50)}`);
  facts("latency-facts", [["median", ms(latencies.p50)], ["95 %", ms(latencies.p95)], ["99 %", ms(latencies.p99)], ["longest", ms(latencies.longest)]]);
  canvas.setAttribute("aria-label", `Histogram of ${latencies.count} latencies: median ${ms(latencies.p50)}, 99 % below ${ms(latencies.p99)}`);
}

function recolour() {
  colour = colours();
  if (run) history_.build(colour);
}
themed(recolour);

// What a test or a curious person may ask of the page in the console.
window.monochord = { get moment() { return moment; }, get run() { return run; }, counts, view, spectra, history: history_, send };
requestAnimationFrame(frame);
