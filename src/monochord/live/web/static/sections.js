// Sections that fold, and the explanation for somebody who knows nothing of the page yet.

import { millimetres } from "./state.js";
import { keep, kept } from "./theme.js";

const element = (id) => document.getElementById(id);
const SMALL = matchMedia("(max-width: 720px), (max-height: 480px)");

// Open on a large screen and folded on a small one, until a person opens or folds a section: then as they left it.
export function foldSections() {
  const sections = [...document.querySelectorAll("details[data-section]")], key = ({ dataset }) => `open:${dataset.section}`;
  const apply = () => {
    for (const each of sections) each.open = (kept(key(each)) ?? String(!SMALL.matches)) === "true";
  };
  for (const each of sections) each.firstElementChild.addEventListener("click", () => keep(key(each), String(!each.open)));
  SMALL.addEventListener("change", apply);
  apply();
}

export function brief(section, text) {
  const place = element(`${section}-brief`);
  if (place.textContent !== text) place.textContent = text;
}

// A link to the page that ends in #about opens the explanation.
export function explain() {
  const about = element("about"), open = () => { if (!about.open) about.showModal(); };
  element("what").addEventListener("click", (event) => { event.preventDefault(); open(); });
  element("about-close").addEventListener("click", () => about.close());
  about.addEventListener("click", ({ target }) => { if (target === about) about.close(); }); // beside it
  if (location.hash === "#about") open();
}

export function explainRun({ length, simulated, controls }) {
  element("about-length").textContent = ` of ${millimetres(length)} mm`;
  element("about-simulated").hidden = !simulated;
  element("about-real").hidden = simulated;
  element("about-hand").hidden = !controls;
}
