// Form of the case, with fields from the declarations of the keys.
import { byId, capitalize, element, scaled } from "./page.js";

/** State of the case: values that differ from their defaults, chosen construction, ranges of moved sliders, and what is not known, by model. */
export const state = { form: [], constructions: [], roomSource: {}, values: {}, model: "", floor: "", chosen: "", room: false, moved: {}, unknowns: {} };

const groupsOf = (part) => state.form.filter((group) => group.part === part);
const commonGroups = () => state.form.filter((group) => group.part === group.name && group.part !== "room");
/** Return the group of a model or floor. */
const findGroup = (part, name) => groupsOf(part).find((group) => group.name === name);

/** Return the title of a model or floor. */
export function titleOf(part, name) {
  return findGroup(part, name)?.title ?? name;
}

/** Return the groups of the current model, floor and room. */
function usedGroups() {
  const groups = [...commonGroups(), findGroup("model", state.model)];
  if (state.floor) groups.push(findGroup("floor", state.floor));
  if (state.room) groups.push(...groupsOf("room"));
  return groups;
}

/** Return the values of the case by group and key. */
export function caseValues() {
  const values = { case: { name: "explored" }, model: { name: state.model } };
  if (state.floor) values.floor = { name: state.floor };
  for (const { fields } of usedGroups())
    for (const { group } of fields) if (state.values[group]) values[group] = state.values[group];
  if (state.room) values.room ??= {};
  if (state.unknowns[state.model]) values.unknowns = state.unknowns[state.model];
  return structuredClone(values);
}

/** Return the fields that a construction fills: those of its floor, and of the ceiling of the room. */
const floorFields = (construction) => findGroup("floor", construction.floor).fields;
const ceilingFields = () => findGroup("room", "room").fields.filter((field) => field.name.startsWith("ceiling_"));

/** Return the construction whose values the form has, if there is one; of several, the chosen one. */
function findConstruction() {
  const hasValues = (fields, values) => fields.every((field) => JSON.stringify(getValue(field)) === JSON.stringify(values[field.name] ?? field.default));
  const found = state.constructions.filter((construction) => construction.floor === state.floor && hasValues(floorFields(construction), construction.keys)
    && (state.room ? hasValues(ceilingFields(), construction.room) : !Object.keys(construction.room).length));
  return found.find(({ name }) => name === state.chosen) ?? found[0];
}

/** Fill the fields of floor and ceiling with the values of a construction; a ceiling needs the room below. */
export function fillConstruction(name) {
  const construction = state.constructions.find((entry) => entry.name === name);
  if (!construction) return;
  state.chosen = name;
  state.floor = construction.floor;
  if (Object.keys(construction.room).length && !state.room) addRoom();
  for (const field of floorFields(construction)) setValue(field, construction.keys[field.name] ?? field.default);
  if (state.room) for (const field of ceilingFields()) setValue(field, construction.room[field.name] ?? field.default);
}

/** Show which construction the form has. */
function showConstruction() {
  const construction = findConstruction();
  byId("construction").value = construction?.name ?? "";
  byId("construction_text").textContent = construction?.text ?? "";
  byId("construction_text").hidden = !construction;
}

/** Return a text of floor, room and the values that differ from their defaults. */
export function describeChanges() {
  const changes = [];
  const construction = findConstruction();
  const filled = construction ? [...floorFields(construction), ...ceilingFields()] : [];
  if (state.floor) changes.push(`Floor: ${construction?.name ?? titleOf("floor", state.floor)}`);
  if (state.room) changes.push("Room below");
  for (const { fields } of usedGroups()) {
    for (const field of fields) {
      if (filled.includes(field)) continue;
      const value = state.values[field.group]?.[field.name];
      if (value === undefined) continue;
      const shown = field.choices[value] ?? (typeof value === "number" ? scaled(value, -field.power) : String(value));
      changes.push(`${field.label} ${shown} ${field.unit}`.trim());
    }
  }
  return changes.join(", ");
}

/** Return whether values are a case with a known model and floor. */
export function isCase(values) {
  if (!values || typeof values !== "object") return false;
  const isKnown = (part) => !values[part] || findGroup(part, values[part].name);
  return Boolean(isKnown("model") && isKnown("floor"));
}

/** Fill the form with the values of a case. */
export function startWith(values, onChange) {
  const { model, floor, ...rest } = values.room && !values.model ? { ...values, ...state.roomSource } : values;
  Object.assign(state, { model: model?.name ?? groupsOf("model")[0].name, floor: floor?.name ?? "", room: Boolean(rest.room), values: {}, moved: {} });
  state.unknowns = rest.unknowns ? { [state.model]: rest.unknowns } : {};
  for (const { fields } of usedGroups()) {
    for (const field of fields) {
      let value = rest[field.group]?.[field.name];
      if (value === undefined || value === null) continue;
      if (field.kind === "list" && !Array.isArray(value)) value = [value];
      setValue(field, value);
    }
  }
  build(onChange);
}

/** Add the room; a model that was left at its default becomes the source of a room whose case names none. */
export function addRoom() {
  state.room = true;
  state.floor ||= "plate";
  const { model, ...options } = state.roomSource;
  if (state.model !== groupsOf("model")[0].name || state.values[state.model]) return;
  state.model = model.name;
  for (const [group, values] of Object.entries(options)) state.values[group] ??= { ...values };
}

function getValue(field) {
  return state.values[field.group]?.[field.name] ?? field.default;
}

function setValue(field, value) {
  const group = (state.values[field.group] ??= {});
  if (JSON.stringify(value) === JSON.stringify(field.default)) delete group[field.name];
  else group[field.name] = value;
  if (!Object.keys(group).length) delete state.values[field.group];
}

/** Build the form for the current model, floor and room; `onChange` is called after each change. */
export function build(onChange) {
  const sources = findConstruction()?.sources ?? {};
  const named = (names) => commonGroups().filter((group) => names.includes(group.name));
  const elements = (groups, isOpen) => groups.filter((group) => group?.fields.length).map((group) => groupElement(group, isOpen, onChange, ["floor", "room"].includes(group.part) ? sources : {}));
  byId("groups").replaceChildren(...elements([...named(["ball", "drop"]), findGroup("model", state.model)], true));
  byId("floor_groups").replaceChildren(...elements([findGroup("floor", state.floor)], true));
  byId("room_groups").replaceChildren(...elements(state.room ? groupsOf("room") : [], true));
  byId("other_groups").replaceChildren(...elements(commonGroups().filter((group) => !["ball", "drop"].includes(group.name)), false));
  const options = (name) => groupsOf(name).map((group) => element("option", { value: group.name }, group.title));
  byId("model").replaceChildren(...options("model"));
  byId("floor").replaceChildren(element("option", { value: "" }, "Rigid test floor"), ...options("floor").filter((option) => option.value !== "rigid"));
  const kinds = [...new Set(state.constructions.map(({ kind }) => kind))];
  const ofKind = (kind) => state.constructions.filter((construction) => construction.kind === kind).map(({ name }) => element("option", { value: name }, name));
  byId("construction").replaceChildren(element("option", { value: "" }, "None of the library"), ...kinds.map((kind) => element("optgroup", { label: kind }, ...ofKind(kind))));
  showConstruction();
  byId("model").value = state.model;
  byId("floor").value = state.floor;
  byId("has_room").checked = state.room;
}

/** Return the element of a group; `sources` are those of the values of a construction. */
function groupElement(group, open, onChange, sources) {
  return element("details", { open }, element("summary", {}, group.title), ...group.fields.map((field) => fieldElement(field, onChange, sources[field.name])));
}

function fieldElement(field, onChange, source) {
  const id = `${field.group}.${field.name}`;
  const label = element("label", { for: id, title: field.help }, field.unit ? `${field.label}, ${field.unit}` : field.label);
  const help = element("p", { class: "help", id: `${id}.help` }, source ? `${field.help}. Source of the value: ${source}.` : `${field.help}.`);
  const onInput = (value) => {
    setValue(field, value);
    help.textContent = `${field.help}.`;
    showConstruction();
    onChange();
  };
  const newInputs = { choice: choiceInput, flag: flagInput, list: listInput }[field.kind] ?? numberInput;
  const inputs = newInputs(field, id, onInput);
  for (const input of inputs) input.setAttribute("aria-describedby", `${id}.help`);
  return element("div", { class: "field" }, label, ...inputs, help);
}

function choiceInput(field, id, onInput) {
  const options = Object.entries(field.choices).map(([value, text]) => element("option", { value }, capitalize(text)));
  const select = element("select", { id }, ...options);
  select.value = getValue(field);
  select.addEventListener("change", () => onInput(select.value));
  return [select];
}

function flagInput(field, id, onInput) {
  const box = element("input", { id, type: "checkbox" });
  box.checked = getValue(field);
  box.addEventListener("change", () => onInput(box.checked));
  return [box];
}

function listInput(field, id, onInput) {
  const text = element("input", { id, type: "text", value: [getValue(field)].flat().join(" "), placeholder: "such as 10 20" });
  text.addEventListener("change", () => {
    const numbers = text.value.split(/[\s;,]+/).filter(Boolean).map(Number);
    text.setAttribute("aria-invalid", String(numbers.some(Number.isNaN)));
    if (!numbers.some(Number.isNaN)) onInput(numbers);
  });
  return [text];
}

function numberInput(field, id, onInput) {
  const value = scaled(getValue(field), -field.power);
  const isWhole = field.kind === "whole";
  const number = element("input", { id, type: "number", step: isWhole ? 1 : "any", min: field.lower, max: field.upper, value });
  const send = (entered) => {
    const key = `${field.group}.${field.name}`;
    const converted = scaled(entered, field.power);
    const ends = (state.moved[key] ??= [getValue(field), getValue(field)]);
    state.moved[key] = [Math.min(ends[0], converted), Math.max(ends[1], converted)];
    onInput(converted);
  };
  const slider = field.slider ? sliderInput(field, value, (entered) => {
    number.value = entered;
    number.setAttribute("aria-invalid", "false");
    send(entered);
  }) : null;
  number.addEventListener("change", () => {
    const isInvalid = number.value === "" || !Number.isFinite(Number(number.value));
    number.setAttribute("aria-invalid", String(isInvalid));
    if (isInvalid) return;
    slider?.moveTo(Number(number.value));
    send(Number(number.value));
  });
  return slider ? [number, slider] : [number];
}

/** Return a slider on a linear or logarithmic scale; `onMove` is called with the selected value. */
function sliderInput(field, value, onMove) {
  const { ends: [low, high], log } = field.slider;
  const isWhole = field.kind === "whole";
  const toSlider = log ? Math.log : (x) => x;
  const fromSlider = log ? Math.exp : (x) => x;
  const slider = element("input", { type: "range", "aria-label": field.label, min: toSlider(low), max: toSlider(high), step: isWhole ? 1 : "any" });
  const announce = (selected) => slider.setAttribute("aria-valuetext", `${selected} ${field.unit}`.trim());
  slider.moveTo = (selected) => { slider.value = toSlider(selected); announce(selected); };
  slider.moveTo(value);
  slider.addEventListener("input", () => {
    const exact = fromSlider(Number(slider.value));
    // Rounding must not exceed the ends.
    const selected = Math.min(high, Math.max(low, isWhole ? Math.round(exact) : Number(exact.toPrecision(4))));
    announce(selected);
    onMove(selected);
  });
  return slider;
}

/** Build the fields of what the file of a recording does not state. */
export function buildRecording(fields) {
  const elements = (folded) => fields.filter((field) => field.folded === folded).map(recordingField);
  byId("fields_of_recording").replaceChildren(...elements(false),
    element("details", {}, element("summary", {}, "Standard uncertainties, force plate and filter"), ...elements(true)));
}

function recordingField({ name, label, kind, hint, choices }) {
  const id = `recording_${name}`;
  const options = Object.entries({ "": "not known", ...choices }).map(([value, text]) => element("option", { value }, text));
  const isNumber = kind === "number";
  const input = kind === "choice" ? element("select", { id }, ...options) : element("input", { id, type: kind, step: isNumber && "any", min: isNumber && "0" });
  return element("div", { class: "field" }, element("label", { for: id }, label + hint), input);
}

/** Mark only the field that is named in a message of the server as invalid. */
export function markField(message) {
  for (const input of document.querySelectorAll("#form [aria-invalid=true]")) input.setAttribute("aria-invalid", "false");
  const [, group, name] = message?.match(/&(\w+): (\w+)/) ?? [];
  byId(`${group}.${name}`)?.setAttribute("aria-invalid", "true");
}
