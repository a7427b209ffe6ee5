// Labelled touches: what a person adds to the step of the page, with a ruler and a kitchen scale.

const GRAM = 9.80665e-3; // N
const element = (id) => document.getElementById(id);

function made(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

export class Labels {
  constructor(ask, begin) {
    const count = made("input", { id: "label-count", type: "number", min: 1, max: 100, value: 10, required: true });
    const start = made("button", { id: "label", type: "button", textContent: "Label touches" });
    start.addEventListener("click", () => begin({ do: "label", touches: Number(count.value) }));
    element("calibrating").before(made("span", { className: "row" }, start, made("label", {}, count, " touches")));

    const force = element("known-force");
    this.unit = made("select", { id: "known-unit", ariaLabel: "unit of the force" },
      made("option", { value: "g", textContent: "g" }), made("option", { value: "N", textContent: "N" }));
    force.nextSibling.remove(); // the unit is chosen
    force.after(" ", this.unit);
    Object.assign(force, { min: 0, step: "any" });
    this.unit.value = localStorage.getItem("unit") ?? "N";
    this.unit.addEventListener("change", () => {
      localStorage.setItem("unit", this.unit.value);
      force.value = this.unit.value === "g" ? (force.value / GRAM).toFixed(0) : (force.value * GRAM).toFixed(2);
    });

    this.buttons = made("p", { id: "steps", className: "row" });
    for (const [act, text] of [["announce", "Not heard: it is so now"], ["undo", "Undo"], ["skip", "Another place"]]) {
      const button = made("button", { id: `step-${act}`, type: "button", textContent: text });
      button.addEventListener("click", () => ask({ do: "step", act }));
      this.buttons.append(button);
    }
    this.doubt = made("p", { id: "doubt", className: "aside", hidden: true });
    element("lines").before(this.buttons, this.doubt);
    this.started = [start, count];
  }

  // Position in m, force in the unit; an empty cell is one that was not measured.
  known() {
    const value = (id, scale) => (element(id).value === "" ? null : Number(element(id).value) * scale);
    return { position: value("known-position", 1e-3), force: value("known-force", 1), unit: this.unit.value };
  }

  propose(position, force) {
    element("known-position").value = (1e3 * position).toFixed(0);
    element("known-force").value = this.unit.value === "g" ? (force / GRAM).toFixed(0) : force.toFixed(1);
  }

  show(guided) {
    const touches = Boolean(guided?.of), { phase, typed, count, doubt, lacks } = guided ?? {};
    for (const node of this.started) node.disabled = Boolean(guided);
    this.buttons.hidden = !touches;
    this.doubt.hidden = !doubt;
    this.doubt.textContent = doubt ?? "";
    if (!touches) return;
    element("step-announce").hidden = !typed || phase === "label";
    element("step-undo").disabled = !count && !["hold", "label"].includes(phase);
    element("step-skip").hidden = !["rest", "press"].includes(phase);
    const submit = element("typed").lastElementChild;
    submit.disabled = !lacks;
    submit.textContent = phase === "press" ? "It is held now" : "Save";
  }
}
