// A recording, and tuning and calibration step by step. The server says what is to be done; it names all files.

import { Labels } from "./label.js";
import { brief } from "./sections.js";
import { span } from "./state.js";

const element = (id) => document.getElementById(id);

export class Tasks {
  constructor(send) {
    this.send = send;
    this.key = "";
    this.wished = { on: false, until: 0 }; // what Record was pressed for, until that is so or refused
    element("record").addEventListener("click", () => this.record(!this.recording));
    element("tune").addEventListener("click", () => this.begin({ do: "tune" }));
    element("calibrate").addEventListener("click", () => this.begin({ do: "calibrate", touches: this.number("count") }));
    element("cancel").addEventListener("click", () => this.ask({ do: "cancel" }));
    element("typed").addEventListener("submit", (event) => {
      event.preventDefault();
      this.ask({ do: "hold", ...this.labels.known() });
    });
    this.labels = new Labels((message) => this.ask(message), (message) => this.begin(message));
  }

  // A known touch outside the sensing range teaches nothing: it is refused where it is typed.
  allow({ range }) {
    const place = element("known-position");
    place.oninput = () => {
      const metres = this.number("known-position") / 1e3, outside = range && (metres < range[0] || metres > range[1]);
      place.setCustomValidity(outside ? `The sensing range is ${span(range)}: choose a position inside it.` : "");
    };
  }

  number(id) { return Number(element(id).value); }

  // What is said of a command that does not take effect.
  say(text) { put("answer", text); }

  ask(message) {
    this.say("");
    this.key = ""; // what the server says of it is shown, be it as before
    return this.send(message);
  }

  get recording() { return performance.now() < this.wished.until ? this.wished.on : Boolean(this.tasks?.recording); }

  record(on) {
    if (this.ask({ do: "record", on })) this.wished = { on, until: performance.now() + 1000 };
    this.button();
  }

  button() {
    const button = element("record"), pressed = String(this.recording);
    put("record", this.recording ? "Stop recording" : "Record");
    if (button.getAttribute("aria-pressed") !== pressed) button.setAttribute("aria-pressed", pressed);
  }

  // A simulated string that is touched by itself would never be let go of. The step is shown below the string.
  begin(message) {
    if (this.settings?.some(({ name }) => name === "touches")) this.send({ do: "change", name: "touches", value: "by hand" });
    const string = element("string-section");
    if (this.ask(message) && string.getBoundingClientRect().top < 0) string.scrollIntoView();
  }

  show({ tasks, settings }) {
    this.settings = settings;
    const key = JSON.stringify(tasks), { recording, guided, lines, saved, calibrates, answer } = tasks, done = lines.length > 0;
    if (answer || Boolean(recording) === this.wished.on) this.wished.until = 0;
    this.tasks = tasks;
    this.button();
    if (key === this.key) return;
    this.key = key;
    this.say(answer);
    put("recorded", recording ? `${recording.seconds.toFixed(1)} s into ${recording.path || "a new file"}` : saved);
    brief("tasks", recording ? `recording, ${recording.seconds.toFixed(1)} s` : "");
    element("tune").disabled = element("calibrate").disabled = element("count").disabled = Boolean(guided);
    element("calibrating").hidden = !calibrates;
    element("guided").hidden = !guided && !done;
    this.labels.show(guided);
    if (guided) this.step(guided);
    else if (done) this.result(lines);
  }

  step(guided) {
    const { says, share, count, of, typed, position, force, name } = guided;
    const touch = of && count < of ? `Touch ${count + 1} of ${of}. ` : "";
    const title = { tuning: "Tune", calibration: "Calibrate", labelling: "Label touches" }[name];
    put("says", `${title}: ${touch}${says}`);
    element("share").hidden = share === undefined;
    element("share").value = share ?? 0;
    element("cancel").textContent = name === "labelling" && count ? "Finish" : "Cancel";
    element("lines").textContent = "";
    const asks = Boolean(typed && position !== undefined);
    if (asks && element("typed").hidden) this.proposed = null;
    element("typed").hidden = !asks;
    if (asks && this.proposed !== position) { // the values are a proposal; a person types the true ones
      this.proposed = position;
      this.labels.propose(position, force);
      element("known-position").oninput?.();
    }
  }

  result(lines) {
    put("says", "Result");
    element("share").hidden = element("typed").hidden = true;
    element("cancel").textContent = "Close";
    put("lines", lines.join("\n"));
  }
}

function put(id, text) {
  const place = element(id);
  if (place.textContent !== text) place.textContent = text;
}
