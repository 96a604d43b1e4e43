// The parameters of all sets, as their descriptions make them; what is set anywhere is shown everywhere.

import { confirmButton, el, notify, setText, show, storage, whilePending } from "./dom.js";
import { ownFirst, store } from "./store.js";
import { Widget } from "./widget.js";

export function startParameters(link) {
  const filter = el("input", { type: "search", placeholder: "Filter parameters", "aria-label": "Filter parameters", oninput: () => applyFilter() });
  const run = el("input", { type: "checkbox", id: "run-only", checked: storage.get("run", true), onchange: () => storage.set("run", run.checked) });
  const empty = el("p", { class: "hint" }, "No parameters are announced: is the params service running?");
  const list = el("div", { class: "sets" });
  const element = el("aside", { class: "pane parameters" }, filter,
    el("label", { class: "line", title: "Changes are not saved for later runs" }, run, "this run only"), empty, list);
  const sets = new Map(); // name -> {element, widgets: Map, note, text}

  function build({ sets: all }) {
    const schemas = ownFirst(all, (each) => each.set);
    show(empty, schemas.length === 0);
    for (const [name, set] of sets) if (!schemas.some((each) => each.set === name)) { set.element.remove(); sets.delete(name); }
    schemas.forEach((schema, index) => {
      const text = JSON.stringify(schema.parameters);
      let set = sets.get(schema.set);
      if (!set || set.text !== text) {
        const made = make(schema, text, set?.element.open ?? schemas.length < 3);
        set?.element.remove();
        sets.set(schema.set, set = made);
        const values = store.values.get(schema.set);
        if (values) fill(values);
      }
      if (list.children[index] !== set.element) list.insertBefore(set.element, list.children[index] ?? null);
    });
    applyFilter();
  }

  function make(schema, text, open) {
    const set = { widgets: new Map(), text, note: el("p", { class: "reason", hidden: true }) };
    const change = async (values) => fill(await link.call({ k: "set", set: schema.set, values, run: run.checked }));
    for (const description of schema.parameters) {
      set.widgets.set(description.name, new Widget(description, change, (name, button) => unset(schema.set, [name], button)));
    }
    const history = el("ol", { class: "history", hidden: true });
    set.element = el("details", { class: "set", open },
      el("summary", {}, el("span", { class: "name" }, schema.set), el("small", { class: "quiet" }, `${schema.parameters.length}`)),
      el("div", { class: "line tools" },
        el("button", { class: "small", title: "Undo the newest change", onclick: ({ currentTarget }) => request({ k: "undo", set: schema.set }, currentTarget) }, "Undo"),
        confirmButton("Reset all", (button) => unset(schema.set, [], button), { class: "small", title: "Return to the values of the fleet file and the defaults" }),
        el("button", { class: "small", onclick: ({ currentTarget }) => showHistory(schema.set, history, currentTarget) }, "History")),
      set.note, history, ...[...set.widgets.values()].map((each) => each.element));
    return set;
  }

  const request = (message, ...buttons) => whilePending(buttons, link.call(message)).catch((error) => notify(error.message, "bad"));
  const unset = (set, names, ...buttons) => request({ k: "unset", set, names }, ...buttons);

  async function showHistory(set, element, button) {
    if (!element.hidden) { element.hidden = true; return; }
    try {
      const { changes } = await whilePending([button], link.call({ k: "history", set, limit: 30 }));
      element.replaceChildren(...(changes.length ? changes.map(line) : [el("li", { class: "quiet" }, "no changes yet")]));
      element.hidden = false;
    } catch (error) { notify(error.message, "bad"); }
  }

  function line(change) {
    const when = new Date(change.wall_time / 1e6).toLocaleTimeString();
    const what = change.after.map(({ name, value }) => `${name} = ${JSON.stringify(value)}`).join(", ");
    return el("li", { class: change.undone ? "undone" : "" }, el("span", { class: "quiet" }, `${when} ${change.who} ${change.kind} `), what);
  }

  function fill(values) {
    const set = sets.get(values.set);
    if (!set) return;
    setText(set.note, values.note);
    show(set.note, Boolean(values.note));
    for (const { name, value, origin } of values.values) set.widgets.get(name)?.update(value, origin);
  }

  function applyFilter() {
    const wanted = filter.value.trim().toLowerCase();
    for (const [name, { element: shown, widgets }] of sets) {
      let any = false;
      for (const [parameter, widget] of widgets) {
        const fits = `${name} ${parameter} ${widget.description.text}`.toLowerCase().includes(wanted);
        show(widget.element, fits);
        any ||= fits;
      }
      show(shown, any);
      if (wanted && any) shown.open = true;
    }
  }

  link.on("sets", build);
  link.on("values", ({ sets: news }) => news.forEach(fill));
  return { element };
}
