// A recording, and tuning and calibration step by step. The server says what is to be done; it names all files.

import { span } from "./state.js";

const element = (id) => document.getElementById(id);

export class Tasks {
  constructor(send) {
    this.send = send;
    this.key = "";
    element("record").addEventListener("click", () => send({ do: "record", on: !this.tasks?.recording }));
    element("tune").addEventListener("click", () => this.begin({ do: "tune" }));
    element("calibrate").addEventListener("click", () => this.begin({ do: "calibrate", touches: this.number("count") }));
    element("cancel").addEventListener("click", () => send({ do: "cancel" }));
    element("typed").addEventListener("submit", (event) => {
      event.preventDefault();
      send({ do: "hold", position: this.number("known-position") / 1e3, force: this.number("known-force") });
    });
  }

  // A known touch outside the sensing range teaches nothing: it is refused where it is typed.
  allow({ range }) {
    const place = element("known-position");
    place.oninput = () => {
      const metres = this.number("known-position") / 1e3, outside = range && (metres < range[0] || metres > range[1]);
      place.setCustomValidity(outside ? `The sensor tells places from ${span(range)}: choose one there.` : "");
    };
  }

  number(id) { return Number(element(id).value); }

  // A simulated string that is touched by itself would never be let go of.
  begin(message) {
    if (this.settings?.some(({ name }) => name === "touches")) this.send({ do: "change", name: "touches", value: "by hand" });
    this.send(message);
  }

  show({ tasks, settings }) {
    this.settings = settings;
    const key = JSON.stringify(tasks);
    if (key === this.key) return;
    this.key = key;
    this.tasks = tasks;
    const { recording, guided, lines, saved, calibrates } = tasks, done = lines.length > 0;
    const record = element("record"), words = recording ? "Stop recording" : "Record";
    if (record.textContent !== words) record.textContent = words;
    record.setAttribute("aria-pressed", String(Boolean(recording)));
    put("recorded", recording ? `${recording.seconds.toFixed(1)} s into ${recording.path}` : saved);
    element("tune").disabled = element("calibrate").disabled = element("count").disabled = Boolean(guided);
    element("calibrating").hidden = !calibrates;
    element("guided").hidden = !guided && !done;
    if (guided) this.step(guided);
    else if (done) this.result(lines);
  }

  step(guided) {
    const { says, share, count, of, typed, position, force, name } = guided;
    const touch = of && count < of ? `Touch ${count + 1} of ${of}. ` : "";
    put("says", `${name === "tuning" ? "Tune" : "Calibrate"}: ${touch}${says}`);
    element("share").hidden = share === undefined;
    element("share").value = share ?? 0;
    element("cancel").hidden = share === undefined;
    element("cancel").textContent = "Cancel";
    element("lines").textContent = "";
    const asks = Boolean(typed && position !== undefined);
    if (asks && element("typed").hidden) this.proposed = null;
    element("typed").hidden = !asks;
    if (asks && this.proposed !== count) { // the values are a proposal; a person types the true ones
      this.proposed = count;
      element("known-position").value = (1e3 * position).toFixed(0);
      element("known-force").value = force.toFixed(1);
      element("known-position").oninput?.();
    }
  }

  result(lines) {
    put("says", "Result");
    element("share").hidden = element("typed").hidden = true;
    element("cancel").hidden = false;
    element("cancel").textContent = "Close";
    put("lines", lines.join("\n"));
  }
}

function put(id, text) {
  const place = element(id);
  if (place.textContent !== text) place.textContent = text;
}
