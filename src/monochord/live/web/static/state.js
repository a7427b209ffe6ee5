// A run's messages, and what the newest said. Drawing asks here, 60 times a second, whatever comes in.

import { Connection, showConnection } from "./connection.js";

const SILENCE = 3000; // ms without a moment after which those that are shown are old
const MOST_WAITING = 4096; // bytes that wait to be sent above which a touch is left out

export class Run {
  constructor(listeners) {
    this.listeners = listeners; // {lost, hello, moment, spectrum}
    this.received = null; // when the newest moment came, on this connection
    setInterval(() => this.listen(), 500);
    this.connection = new Connection("live", {
      opened: () => showConnection("waiting", "waiting for the first sound"),
      message: (data) => this.take(data),
      lost: () => {
        this.received = null;
        listeners.lost();
      },
    });
  }

  // A connection may be open while nothing comes: a run that computes or is stopped, a network that is gone.
  listen() {
    if (this.received === null || performance.now() - this.received < SILENCE) return;
    showConnection("silent", "nothing new for some seconds");
  }

  take(data) {
    if (data instanceof ArrayBuffer) return this.listeners.spectrum(unpacked(data));
    const message = JSON.parse(data);
    if (message.type === "hello") {
      this.listeners.hello(message);
    } else if (message.type === "moment") {
      this.received = performance.now();
      showConnection("live", "live");
      this.listeners.moment(message);
    }
  }

  // Returns whether it is sent.
  send(message) { return this.connection.send(message, message.do === "touch" ? MOST_WAITING : Infinity); }
}

function unpacked(buffer) {
  const channels = new Uint8Array(buffer, 0, 1)[0];
  const top = new DataView(buffer).getFloat32(4, true);
  const bars = (buffer.byteLength - 8) / channels;
  const rows = Array.from({ length: channels }, (_, k) => new Uint8Array(buffer, 8 + k * bars, bars));
  return { top, rows };
}

// The newest estimate of a name: followed over time where it is, else of the window alone.
export function estimate(moment, name) {
  const each = moment.tracked[name] ?? moment.window[name];
  return each && each.value !== null ? each : null;
}

export function decision(moment, name) {
  if (name in moment.decided) return moment.decided[name];
  const each = moment.window[name];
  return each && each.value !== null ? each.value > 0.5 : null;
}

// The abstention that says why there is no estimate of a name; undefined where there is one, or nobody says.
function abstention(moment, name) {
  return estimate(moment, name) ? undefined : [moment.tracked[name], moment.window[name]].find((each) => each?.why);
}

// Why there is no estimate of a name, in words and as a key; empty where there is one, or nobody says.
export function reason(moment, name) { return abstention(moment, name)?.why ?? ""; }
export function reasonKey(moment, name) { return abstention(moment, name)?.key ?? ""; }

// Whether something touches where the sensor cannot tell places.
export function isOutside(moment) {
  return Boolean(touched(moment)) && reasonKey(moment, "position") === "outside_range";
}

// Metres in mm without needless digits, and a range in words, "50 to 150 mm", that stays in one line.
export function millimetres(metres) { return String(Number((1e3 * metres).toFixed(1))); }
export function span([low, high]) { return `${millimetres(low)}\u00a0to\u00a0${millimetres(high)}\u00a0mm`; }

// Whether something touches: null where it is not known. An estimator without contact says so by its position.
export function touched(moment) {
  return "contact" in moment.window ? decision(moment, "contact") : estimate(moment, "position") !== null;
}
