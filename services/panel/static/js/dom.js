// Elements without markup: text never becomes HTML.

export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made && name !== "list" && name !== "form") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter((each) => each !== null && each !== undefined));
  return made;
}

export function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// A robot as people call it, by its namespace; that of the root is "/".
export const robotName = (ns) => ns.slice(1) || ns;

export const byId = (id) => document.getElementById(id);

// Set text only when it differs: a write costs layout.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// A number with two decimals; what rounds to zero has no sign.
export function twoDecimals(value) {
  return (Math.round(value * 100) / 100 + 0).toFixed(2);
}

export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

// Give a place other contents, and leave what stays the same where it is: a button that is pressed just now, the focus.
export function updateChildren(place, children) {
  const wanted = el("div", {}, ...children);
  if (alike(place, wanted, true)) copy(place, wanted, true);
  else place.replaceChildren(...wanted.childNodes);
}

function alike(a, b, outermost = false) {
  if (!outermost && (a.nodeName !== b.nodeName || (a.nodeName === "BUTTON" && a.textContent !== b.textContent))) return false;
  return a.childNodes.length === b.childNodes.length && [...a.childNodes].every((each, i) => alike(each, b.childNodes[i]));
}

function copy(a, b, outermost = false) {
  if (a.nodeType === Node.TEXT_NODE) { if (a.data !== b.data) a.data = b.data; return; }
  if (!outermost && a.className !== b.className) a.className = b.className;
  a.childNodes.forEach((each, i) => copy(each, b.childNodes[i]));
}

// Disable buttons until what they have asked for is answered: a second click would ask for it twice.
export async function whilePending(buttons, asked) {
  for (const each of buttons) { each.disabled = true; each.classList.add("pending"); }
  try { return await asked; } finally {
    for (const each of buttons) { each.disabled = Boolean(each.dataset.why); each.classList.remove("pending"); }
  }
}

// Enable a control, or grey it and say why in its tooltip; `reason` is empty while it can be used.
export function setEnabled(control, reason) {
  const title = control.dataset.title ?? (control.dataset.title = control.title);
  control.dataset.why = reason;
  if (!control.classList.contains("pending")) control.disabled = Boolean(reason);
  control.title = reason || title;
}

// A button that asks once more before it acts.
export function confirmButton(label, act, attributes = {}) {
  let armed = 0;
  const button = el("button", { ...attributes, onclick: () => {
    if (armed) { calm(); act(button); return; }
    armed = setTimeout(calm, 3000);
    button.textContent = "Sure?";
    button.classList.add("armed");
  } }, label);
  function calm() {
    clearTimeout(armed);
    armed = 0;
    button.textContent = label;
    button.classList.remove("armed");
  }
  return button;
}

// A function that asks for a drawing in the page's next frame, once however often it is called until then.
export function perFrame(draw) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame((now) => { asked = false; draw(now); });
  };
}

// A small sentence that passes.
export function notify(text, kind = "") {
  const notes = byId("notes");
  const last = notes.lastElementChild;
  if (last && last.dataset.text === text) return;
  const made = el("div", { class: `note ${kind}` }, text);
  made.dataset.text = text;
  notes.append(made);
  while (notes.children.length > 4) notes.firstElementChild.remove();
  setTimeout(() => made.remove(), kind === "bad" ? 9000 : 4000);
}

// What a browser remembers of this page; without storage it forgets.
export const storage = {
  get(name, otherwise) {
    try {
      const kept = localStorage.getItem(`elea.${name}`);
      return kept === null ? otherwise : JSON.parse(kept);
    } catch { return otherwise; }
  },
  set(name, value) {
    try { localStorage.setItem(`elea.${name}`, JSON.stringify(value)); } catch { /* forgotten */ }
  },
};
