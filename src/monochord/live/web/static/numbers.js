// Estimates, truth and counters in words and numbers.

import { brief } from "./sections.js";
import { decision, estimate, isOutside, reason, touched } from "./state.js";

const element = (id) => document.getElementById(id);

export function inUnit(value, unit) {
  if (unit === "m") return `${(1e3 * value).toFixed(1)} mm`;
  return `${value.toFixed(2)} ${unit}`.trim();
}

function put(id, value, spread, more, on) {
  const card = element(id);
  const [, shown, below] = card.children;
  const text = `${value}|${spread}|${more.text}|${more.truth}`;
  if (card.dataset.text === text) return;
  card.dataset.text = text;
  card.dataset.on = String(on);
  shown.textContent = value;
  if (spread) {
    const small = document.createElement("small");
    small.textContent = ` ± ${spread}`;
    shown.append(small);
  }
  below.textContent = more.text;
  if (more.truth) {
    const span = document.createElement("span");
    span.className = "true";
    span.textContent = `◇ ${more.truth}`;
    below.append(span);
  }
}

function truthOf(moment, name, words) {
  const value = moment.truth[name];
  if (value === undefined || value === null) return "";
  return `true: ${words(value)}`;
}

// The probability of the word that is shown: of yes where it is on, else of no. It is not rounded to a certainty.
function chance(moment, name, on) {
  const each = estimate(moment, name);
  if (on === null || !each) return reason(moment, name) || "not estimated";
  const share = on ? each.value : 1 - each.value;
  return `${(Math.floor(1e3 * share) / 10).toFixed(share < 0.99 ? 0 : 1)} % likely`;
}

export function showNumbers(moment) {
  const contact = touched(moment), slip = decision(moment, "slip");
  const yes = (a, b) => (value) => (value > 0.5 ? a : b);
  put("reading-contact", contact === null ? "–" : contact ? "touched" : "untouched", "", {
    text: chance(moment, "contact", contact), truth: truthOf(moment, "contact", yes("touched", "untouched")),
  }, Boolean(contact));
  for (const [name, unit] of [["position", "m"], ["force", "N"]]) {
    const each = contact ? estimate(moment, name) : null;
    const why = each ? "" : contact === false ? "no contact" : reason(moment, name) || "not estimated";
    put(`reading-${name}`, each ? inUnit(each.value, unit) : "–",
      each && each.std !== null ? inUnit(each.std, unit) : "",
      { text: why, truth: truthOf(moment, name, (value) => inUnit(value, unit)) }, each !== null);
  }
  put("reading-slip", !contact || slip === null ? "–" : slip ? "sliding" : "at rest", "", {
    text: contact === false ? "no contact" : chance(moment, "slip", slip),
    truth: truthOf(moment, "slip", yes("sliding", "at rest")),
  }, Boolean(contact && slip));
}

// The pitch of the untouched string, as it was last measured.
export function showPitch({ pitch }) {
  const place = element("pitch");
  place.hidden = !pitch;
  const text = pitch ? inWords(pitch) : "";
  if (place.lastElementChild.textContent !== text) place.lastElementChild.textContent = text;
}

function inWords({ frequency, std, deviation, follows }) {
  if (frequency === null || deviation === null) return "not measured yet";
  const cents = Math.round(1200 * Math.log2(1 + deviation)), known = frequency / (1 + deviation);
  const size = Math.abs(cents) === 1 ? "1 cent" : `${Math.abs(cents)} cents`, side = cents < 0 ? "below" : "above";
  const off = cents ? `${size} ${side} the known ${known.toFixed(1)} Hz` : "as known";
  return `${frequency.toFixed(1)} Hz ± ${std.toFixed(1)} Hz, ${off}${follows ? "" : "; estimates do not follow"}`;
}

export function showNotes(moment) {
  const place = element("notes");
  const key = moment.notes.map((note) => note.key + note.sentence).join("|");
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  place.hidden = false; // its room stays where there is none, so that nothing below moves
  place.replaceChildren(...moment.notes.map((note) => {
    const line = document.createElement("p");
    line.className = "note";
    line.dataset.level = note.level;
    const level = document.createElement("b");
    level.textContent = { info: "Note.", warning: "Warning.", error: "Error." }[note.level] ?? "";
    const remedy = document.createElement("span");
    remedy.className = "remedy";
    remedy.textContent = ` ${note.remedy}`;
    line.append(level, note.sentence, remedy);
    return line;
  }));
}

export function facts(id, pairs) {
  const list = element(id);
  if (list.children.length !== pairs.length) {
    list.replaceChildren(...pairs.map(([name]) => {
      const pair = document.createElement("div");
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = name;
      pair.append(dt, dd);
      return pair;
    }));
  }
  pairs.forEach(([, value], k) => {
    const dd = list.children[k].lastChild;
    if (dd.textContent !== value) dd.textContent = value;
  });
}

export function showStream(moment) {
  const { health, server } = moment;
  brief("stream", `${health.dropped} lost, ${health.skipped} skipped`);
  facts("stream-facts", [
    ["time", `${moment.time.toFixed(1)} s`],
    ["skipped", `${health.skipped}`],
    ["gaps", `${health.gaps}`],
    ["lost frames", `${health.dropped}`],
    ["xruns", `${health.xruns}`],
    ["pages open", `${server.clients}`],
  ]);
}

const EVENT = {
  contact: { true: "contact begins", false: "contact ends" },
  slip: { true: "slip begins", false: "slip ends" },
};

export function showEvents(events) {
  const list = element("events");
  const newest = events.length ? String(events[events.length - 1].number) : "";
  if (list.dataset.newest === newest) return;
  list.dataset.newest = newest;
  list.replaceChildren(...[...events].reverse().slice(0, 6).map((event) => {
    const line = document.createElement("li");
    const what = document.createElement("span"), when = document.createElement("span");
    what.textContent = EVENT[event.name]?.[event.on] ?? `${event.name} ${event.on ? "on" : "off"}`;
    const sure = event.confidence === null ? "" : `, confidence ${Math.round(100 * event.confidence)} %`;
    when.textContent = `at ${event.time.toFixed(2)} s, decided ${Math.round(1e3 * event.delay)} ms later${sure}`;
    line.append(what, when);
    return line;
  }));
}

// What a screen reader says: changes alone, no more than one a second, those of contact first. A touch is said
// after RISING, when its force has risen, and with its place, unless none comes within PLACING.
const speech = { state: "", next: 0, untouched: 0, placed: 0, notes: new Set(), nextNote: 0 };
const RISING = 200, PLACING = 500; // ms
export function speak(moment) {
  const now = performance.now(), contact = touched(moment);
  if (!contact) speech.untouched = now;
  if (!contact || estimate(moment, "position") || isOutside(moment)) speech.placed = now;
  if (now < speech.next) return;
  const waits = contact && (now < speech.untouched + RISING || (speech.placed < now && now < speech.placed + PLACING));
  const said = waits ? null : newState(moment) ?? newNote(moment, now);
  if (!said) return;
  speech.next = now + 1000;
  element("spoken").textContent = said;
}

function newState(moment) {
  const contact = touched(moment), slip = decision(moment, "slip");
  const outside = isOutside(moment) ? " outside the sensing range" : "";
  const state = contact === null ? "contact not known" : contact ? (slip ? "sliding" : "touched") + outside : "untouched";
  if (state === speech.state) return null;
  speech.state = state;
  const position = estimate(moment, "position"), force = estimate(moment, "force");
  const where = contact && position ? ` at ${Math.round(1e3 * position.value)} millimetres` : "";
  const strength = contact && force ? `, ${force.value.toFixed(1)} newtons` : "";
  return `${state}${where}${strength}`;
}

// A note is said when it comes, not whenever a number in it changes.
function newNote({ notes }, now) {
  if (now < speech.nextNote) return null;
  const fresh = notes.find((note) => !speech.notes.has(note.key));
  speech.notes = fresh ? speech.notes.add(fresh.key) : new Set(notes.map((note) => note.key));
  if (!fresh) return null;
  speech.nextNote = now + 4000;
  return `${fresh.sentence} ${fresh.remedy}`;
}
