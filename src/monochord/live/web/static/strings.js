// Several strings: a button for each, with what touches it, of which one is shown below.

export class Strings {
  constructor(place, choose) {
    this.place = place;
    this.choose = choose;
    this.buttons = new Map();
  }

  show(strings, shown) {
    this.place.hidden = !strings;
    for (const each of strings ?? []) {
      const button = this.buttons.get(each.name) ?? this.add(each.name);
      button.setAttribute("aria-pressed", String(each.name === shown));
      button.dataset.contact = String(Boolean(each.contact));
      button.dataset.note = each.note ?? "";
      const text = words(each);
      if (button.lastElementChild.textContent !== text) button.lastElementChild.textContent = text;
    }
  }

  add(name) {
    const button = document.createElement("button"), title = document.createElement("b");
    button.type = "button";
    title.textContent = name;
    button.append(title, document.createElement("span"));
    button.addEventListener("click", () => this.choose(name));
    this.place.append(button);
    this.buttons.set(name, button);
    return button;
  }
}

function words({ contact, position, force, note }) {
  const worry = note ? `${note}: see its notes` : "";
  if (!contact) return worry || (contact === false ? "untouched" : "–");
  const place = position === null ? "touched" : `${(1e3 * position).toFixed(1)} mm`;
  return force === null ? place : `${place}, ${force.toFixed(2)} N`;
}
