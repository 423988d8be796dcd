// Fields of the case, made from the declarations of the keys.
import { byId, capitalize, element, scaled } from "./page.js";

/** State of the case: values that differ from their defaults, and ranges of moved sliders. */
export const state = { form: [], values: {}, model: "", floor: "", room: false, moved: {} };

const part = (name) => state.form.filter((group) => group.part === name);
const own = () => state.form.filter((group) => group.part === group.name && group.part !== "room");
/** Return the group of the model, floor or room that is chosen. */
const chosen = (name, which) => part(name).find((group) => group.name === which);

/** Return the title of a model or floor. */
export function titleOf(name, which) {
  return chosen(name, which)?.title ?? which;
}

/** Return the groups of keys in use. */
function used() {
  const groups = [...own(), chosen("model", state.model)];
  if (state.floor) groups.push(chosen("floor", state.floor));
  if (state.room) groups.push(...part("room"));
  return groups;
}

/** Return the case as groups of keys. */
export function caseValues() {
  const values = { case: { name: "explored" }, model: { name: state.model } };
  if (state.floor) values.floor = { name: state.floor };
  for (const { fields } of used())
    for (const { group } of fields) if (state.values[group]) values[group] = state.values[group];
  if (state.room) values.room ??= {};
  return structuredClone(values);
}

/** Return floor, room and the values that differ from their defaults, in words. */
export function changedWords() {
  const words = [];
  if (state.floor) words.push(`Floor: ${titleOf("floor", state.floor)}`);
  if (state.room) words.push("Room below");
  for (const { fields } of used()) {
    for (const field of fields) {
      const value = state.values[field.group]?.[field.name];
      if (value === undefined) continue;
      const shown = field.choices[value] ?? (typeof value === "number" ? scaled(value, -field.power) : String(value));
      words.push(`${field.label} ${shown} ${field.unit}`.trim());
    }
  }
  return words.join(", ");
}

/** Return whether values are those of a case; unknown models and floors are no case. */
export function isCase(values) {
  if (!values || typeof values !== "object") return false;
  const known = (name) => !values[name] || chosen(name, values[name].name);
  return Boolean(known("model") && known("floor"));
}

/** Take the values of a case, and show them. */
export function startWith(values, changed) {
  const { model, floor, ...rest } = values;
  Object.assign(state, { model: model?.name ?? part("model")[0].name, floor: floor?.name ?? "", room: Boolean(rest.room), values: {}, moved: {} });
  for (const { fields } of used()) {
    for (const field of fields) {
      let value = rest[field.group]?.[field.name];
      if (value === undefined || value === null) continue;
      if (field.kind === "list" && !Array.isArray(value)) value = [value];
      put(field, value);
    }
  }
  build(changed);
}

function current(field) {
  return state.values[field.group]?.[field.name] ?? field.default;
}

function put(field, value) {
  const group = (state.values[field.group] ??= {});
  if (JSON.stringify(value) === JSON.stringify(field.default)) delete group[field.name];
  else group[field.name] = value;
  if (!Object.keys(group).length) delete state.values[field.group];
}

/** Fill the form for the chosen model, floor and room; `changed` is called on each change. */
export function build(changed) {
  const open = (names) => own().filter((group) => names.includes(group.name));
  const shown = (groups, isOpen) => groups.filter((group) => group?.fields.length).map((group) => groupElement(group, isOpen, changed));
  byId("groups").replaceChildren(...shown([...open(["ball", "drop"]), chosen("model", state.model)], true));
  byId("floor_groups").replaceChildren(...shown([chosen("floor", state.floor)], true));
  byId("room_groups").replaceChildren(...shown(state.room ? part("room") : [], true));
  byId("further_groups").replaceChildren(...shown(own().filter((group) => !["ball", "drop"].includes(group.name)), false));
  const options = (name) => part(name).map((group) => element("option", { value: group.name }, group.title));
  byId("model").replaceChildren(...options("model"));
  byId("floor").replaceChildren(element("option", { value: "" }, "Rigid test floor"), ...options("floor").filter((option) => option.value !== "rigid"));
  byId("model").value = state.model;
  byId("floor").value = state.floor;
  byId("has_room").checked = state.room;
}

function groupElement(group, open, changed) {
  return element("details", { open }, element("summary", {}, group.title), ...group.fields.map((field) => fieldElement(field, changed)));
}

function fieldElement(field, changed) {
  const id = `${field.group}.${field.name}`;
  const label = element("label", { for: id, title: field.help }, field.unit ? `${field.label}, ${field.unit}` : field.label);
  const take = (value) => { put(field, value); changed(); };
  const make = { choice: choiceInput, flag: flagInput, list: listInput }[field.kind] ?? numberInput;
  const inputs = make(field, id, take);
  for (const input of inputs) input.setAttribute("aria-describedby", `${id}.help`);
  const help = element("p", { class: "help", id: `${id}.help` }, `${field.help}.`);
  return element("div", { class: "field" }, label, ...inputs, help);
}

function choiceInput(field, id, take) {
  const options = Object.entries(field.choices).map(([value, words]) => element("option", { value }, capitalize(words)));
  const select = element("select", { id }, ...options);
  select.value = current(field);
  select.addEventListener("change", () => take(select.value));
  return [select];
}

function flagInput(field, id, take) {
  const box = element("input", { id, type: "checkbox" });
  box.checked = current(field);
  box.addEventListener("change", () => take(box.checked));
  return [box];
}

function listInput(field, id, take) {
  const text = element("input", { id, type: "text", value: [current(field)].flat().join(" "), placeholder: "such as 10 20" });
  text.addEventListener("change", () => {
    const numbers = text.value.split(/[\s;,]+/).filter(Boolean).map(Number);
    text.setAttribute("aria-invalid", String(numbers.some(Number.isNaN)));
    if (!numbers.some(Number.isNaN)) take(numbers);
  });
  return [text];
}

function numberInput(field, id, take) {
  const value = scaled(current(field), -field.power);
  const whole = field.kind === "whole";
  const number = element("input", { id, type: "number", step: whole ? 1 : "any", min: field.lower, max: field.upper, value });
  const send = (entered) => {
    const key = `${field.group}.${field.name}`;
    const converted = scaled(entered, field.power);
    const ends = (state.moved[key] ??= [current(field), current(field)]);
    state.moved[key] = [Math.min(ends[0], converted), Math.max(ends[1], converted)];
    take(converted);
  };
  const slider = field.slider ? sliderInput(field, value, (entered) => {
    number.value = entered;
    number.setAttribute("aria-invalid", "false");
    send(entered);
  }) : null;
  number.addEventListener("change", () => {
    const bad = number.value === "" || !Number.isFinite(Number(number.value));
    number.setAttribute("aria-invalid", String(bad));
    if (bad) return;
    slider?.moveTo(Number(number.value));
    send(Number(number.value));
  });
  return slider ? [number, slider] : [number];
}

/** Return a slider; that of a positive number moves in its logarithm. */
function sliderInput(field, value, moved) {
  const { ends: [low, high], log } = field.slider;
  const whole = field.kind === "whole";
  const to = log ? Math.log : (x) => x;
  const from = log ? Math.exp : (x) => x;
  const slider = element("input", { type: "range", "aria-label": field.label, min: to(low), max: to(high), step: whole ? 1 : "any" });
  const announce = (selected) => slider.setAttribute("aria-valuetext", `${selected} ${field.unit}`.trim());
  slider.moveTo = (selected) => { slider.value = to(selected); announce(selected); };
  slider.moveTo(value);
  slider.addEventListener("input", () => {
    const exact = from(Number(slider.value));
    // The ends themselves, not numbers that are rounded beyond them.
    const selected = Math.min(high, Math.max(low, whole ? Math.round(exact) : Number(exact.toPrecision(4))));
    announce(selected);
    moved(selected);
  });
  return slider;
}

/** Mark the field that a message of the server names, and no other. */
export function mark(message) {
  for (const input of document.querySelectorAll("#form [aria-invalid=true]")) input.setAttribute("aria-invalid", "false");
  const [, group, name] = message?.match(/&(\w+): (\w+)/) ?? [];
  byId(`${group}.${name}`)?.setAttribute("aria-invalid", "true");
}
