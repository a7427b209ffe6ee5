// The bring-up of a sensor: the server says which step is next, what is heard and what passed; people choose.

import { Connection, showConnection } from "./connection.js";
import { themed } from "./theme.js";

const element = (id) => document.getElementById(id);
const FLOOR = -90; // dB below full scale at the left end of a meter
const STATUS = { passed: "passed", failed: "to change", skipped: "left out", waiting: "to come" };
const MARK = { true: "passed", false: "failed", null: "left out" };
let state = null, before = null;

const connection = new Connection("bring-up-live", {
  opened: () => showConnection("live", "live"),
  message: (data) => {
    const message = JSON.parse(data);
    if (message.type === "state") show(message);
    else if (message.type === "meter") meter(message);
    else refuse(message.line);
  },
  lost: () => { for (const id of ["record", "skip", "end", "repeat"]) element(id).disabled = true; },
});

const send = (message) => connection.send(message);

function put(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

function refuse(line) {
  element("refusal").hidden = !line;
  put("refusal", line);
}

function made(tag, text, kind = "") {
  const each = document.createElement(tag);
  each.textContent = text;
  if (kind) each.className = kind;
  return each;
}

function checkOf({ name, value, passed, fault, advice }) {
  const row = made("li", "", `check ${MARK[passed].replace(" ", "-")}`);
  row.append(made("span", MARK[passed], "mark"), made("span", name, "name"), made("span", passed === null ? "" : value, "value"));
  if (fault || advice) row.append(made("p", [fault, advice].filter(Boolean).join(": "), "more"));
  return row;
}

// Lights the parts of the drawing that a step is about, and shows where to act and which drivers are on.
function light({ lit, on } = { lit: [], on: [] }) {
  for (const part of document.querySelectorAll("#sensor [data-part]")) {
    part.classList.toggle("lit", lit.includes(part.dataset.part));
    if (part.classList.contains("action")) part.toggleAttribute("hidden", !lit.includes(part.dataset.part));
  }
  for (const word of document.querySelectorAll("#sensor [data-switch]")) {
    const runs = on.includes(Number(word.dataset.switch));
    word.textContent = runs ? " on" : " off";
    word.closest("[data-part]").classList.toggle("on", runs);
  }
}

function show(message) {
  if (state?.phase === "recording" && message.phase !== "recording") before = state.step;
  state = message;
  const { phase, steps, checks, faults, error } = message, ready = phase === "ready", recording = phase === "recording";
  const number = steps.findIndex(({ name }) => name === message.step), step = steps[number];
  const title = (name) => name.replaceAll("_", " ");
  put("step-title", step && phase !== "done" ? `Step ${number + 1} of ${steps.length}: ${title(step.name)}` : `${message.sensor}: ${phase === "done" ? "done" : ""}`);
  put("instruction", phase === "done" ? "Below is what passed and what to change. Any step can be repeated." : `${recording ? "Recording. " : ""}${step.instruction}`);
  put("record", recording ? "Recording …" : step ? `Record ${step.seconds} s` : "Record");
  element("record").disabled = element("skip").disabled = element("end").disabled = !ready;
  element("record").hidden = element("skip").hidden = element("end").hidden = phase === "done";
  element("share").hidden = !recording;
  light(step);
  element("sensor").hidden = phase === "done";
  element("simulated").hidden = !message.simulated;
  refuse(error);
  const latest = checks.filter((each) => each.step === before), status = steps.find(({ name }) => name === before)?.status;
  element("before").hidden = !before || !ready || status === "waiting";
  element("meters").hidden = phase === "done";
  element("repeat").disabled = recording;
  if (before) put("before-title", `${title(before)}: ${STATUS[status]}`);
  element("advice").replaceChildren(...latest.map(checkOf));
  element("result").hidden = phase !== "done";
  const recorded = steps.filter((each) => ["passed", "failed"].includes(each.status)).length;
  put("verdict", `${message.verdict} ${recorded} of ${steps.length} steps are recorded.`);
  element("verdict").className = faults.length ? "warns" : "good";
  element("toml").hidden = !message.toml;
  element("report").hidden = !message.report;
  put("paths", message.paths.length ? `Written to ${message.paths.join(" and ")}.` : message.report && !message.toml ? "There is no sensor file: the pitch is not measured." : "");
  element("steps").replaceChildren(...steps.map((each) => {
    const row = made("li", "", "step-row"), head = made("div", "", "row"), list = made("ul", "", "checks");
    row.dataset.status = each.status;
    if (each.name === message.step && phase !== "done") row.setAttribute("aria-current", "step");
    head.append(made("b", title(each.name)), made("span", each.name === message.step && phase !== "done" ? "now" : STATUS[each.status], "status"));
    if (each.name !== message.step || phase === "done") {
      const verb = ["passed", "failed"].includes(each.status) ? "Repeat" : "Go to", button = made("button", verb);
      button.type = "button";
      button.setAttribute("aria-label", `${verb} ${title(each.name)}`);
      button.disabled = recording;
      button.addEventListener("click", () => send({ do: "repeat", step: each.name }));
      head.append(button);
    }
    list.append(...checks.filter((check) => check.step === each.name).map(checkOf));
    row.append(head, ...(list.children.length ? [list] : []));
    return row;
  }), ...others(steps, checks));
}

// Checks that belong to no step, such as that of a loop-back.
function others(steps, checks) {
  const rest = checks.filter((check) => !steps.some(({ name }) => name === check.step));
  if (!rest.length) return [];
  const row = made("li", "", "step-row"), list = made("ul", "", "checks");
  list.append(...rest.map(checkOf));
  row.append(made("b", "more"), list);
  return [row];
}

function meter({ levels, clips, seconds }) {
  const place = element("meters");
  while (place.children.length < levels.length) {
    const row = made("div", "", "level"), bar = made("div", "", "bar"), frame = made("div", "", "meter"), peak = made("div", "", "peak");
    frame.setAttribute("role", "meter");
    frame.setAttribute("aria-label", `Microphone ${place.children.length + 1}`);
    frame.setAttribute("aria-valuemin", String(FLOOR));
    frame.setAttribute("aria-valuemax", "0");
    frame.append(bar, peak);
    row.append(made("span", `Microphone ${place.children.length + 1}`, "name"), frame, made("span", "", "db"));
    place.append(row);
  }
  levels.forEach(([rms, peak], k) => {
    const [, frame, db] = place.children[k].children, at = (level) => Math.min(Math.max(1 - (level ?? FLOOR) / FLOOR, 0), 1);
    frame.children[0].style.transform = `scaleX(${at(rms)})`;
    frame.children[1].style.left = `calc(${100 * at(peak)}% - 2px)`;
    frame.dataset.clipped = String(clips[k]);
    frame.setAttribute("aria-valuenow", String(Math.max(rms ?? FLOOR, FLOOR)));
    db.textContent = rms === null ? "–" : `${rms.toFixed(0)} dBFS`;
  });
  const step = state?.steps.find(({ name }) => name === state.step);
  if (step) element("share").value = Math.min(seconds / step.seconds, 1);
}

for (const id of ["record", "skip", "end"]) element(id).addEventListener("click", () => send({ do: id, step: state.step ?? "" }));
element("repeat").addEventListener("click", () => send({ do: "repeat", step: before }));
themed(() => {});

// What a test or a curious person may ask of the page in the console.
window.monochord = { get state() { return state; }, send };
