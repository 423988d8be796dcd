// The case and its form: fields of the keys, models, constructions and the room.
import {
  byId, capitalize, element, fieldRow, numberOf, numberProblem, scaled, select,
} from "thud/page.js";
import { pressInputs } from "thud/press.js";

/** What the server says of itself. */
export const about = {};
/** The case: values that differ from their defaults, the chosen construction, what is not known, by
 * model, fields of the recording, names of the user, and the view. */
export const state = {
  door: "ball", model: "", floor: "plate", chosen: "", room: true, values: {}, unknowns: {},
  recording: {}, titles: {}, view: { thirds: false },
};

// Digits of a number in its field.
const DIGITS = 6;
// Pause of typing after which a value is taken over, ms.
const TYPING_PAUSE = 600;

const groupsOf = (part) => about.form.filter((group) => group.part === part);
const commonGroups = () => about.form.filter(({ part, name }) => part === name && part !== "room");
const findGroup = (part, name) => groupsOf(part).find((group) => group.name === name);
const sourceGroups = () => [...commonGroups(), findGroup("model", state.model)].filter(Boolean);
const floorGroups = () =>
  [findGroup("floor", state.floor), ...(showsRoom() ? groupsOf("room") : [])];

/** Return what the server says of a model or a floor. */
export const factsOf = (part, name) =>
  about[`${part}s`].find((facts) => facts.name === name) ?? { title: name, values: {} };

const allFields = () => about.form.flatMap(({ fields }) => fields);

/** Return the field of a key. */
export function findField(group, name) {
  return allFields().find((field) => field.group === group && field.name === name);
}

/** Return the field that switches a field on, if there is one. */
function switchOf(field) {
  const { fields } = about.form.find((group) => group.fields.includes(field));
  return fields.find(({ name }) => name === field.condition[0]);
}

/** Return whether a field has an effect on the case. */
function isUsed(field) {
  const owner = switchOf(field);
  const choices = field.condition.slice(1);
  const isOn = (value) => (choices.length ? choices.includes(value) : [value].flat().some(Boolean));
  return field.models?.includes(state.model) !== false
    && (!owner || (isOn(valueOf(owner)) && isUsed(owner)));
}

const isSame = (one, other) => JSON.stringify(one) === JSON.stringify(other);

/** Return the default of a field: of a calibrated key that of the standard ball by the model. */
export const defaultOf = (field, model = state.model) => field?.standard?.[model] ?? field?.default;

function valueOf(field) {
  return state.values[field.group]?.[field.name] ?? defaultOf(field);
}

function setValue(field, value) {
  const group = (state.values[field.group] ??= {});
  if (isSame(value, defaultOf(field))) delete group[field.name];
  else group[field.name] = value;
  if (!Object.keys(group).length) delete state.values[field.group];
}

/** Return the values of the case of a door by group and key, without those that have no effect. */
export function caseValues(door = state.door) {
  const values = { model: { name: state.model } };
  const hasFloor = door === "floor";
  if (hasFloor) values.floor = { name: state.floor };
  for (const { fields } of [...sourceGroups(), ...(hasFloor ? floorGroups() : [])]) {
    for (const field of fields) {
      const value = state.values[field.group]?.[field.name];
      if (value === undefined || !isUsed(field)) continue;
      (values[field.group] ??= {})[field.name] = value;
    }
  }
  if (hasFloor && showsRoom()) values.room ??= {};
  if (state.unknowns[state.model]) values.unknowns = state.unknowns[state.model];
  return structuredClone(values);
}

const isTable = (values) => Boolean(values) && typeof values === "object" && !Array.isArray(values);

/** Return the known fields of values by group and key, with their values. */
const entriesOf = (values) => Object.entries(values)
  .flatMap(([group, own]) => Object.entries(own).map(([name, value]) => [findField(group, name), value]))
  .filter(([field]) => field);

/** Return whether values are a case of a known model and floor, and of the kinds of their fields. */
export function isCase(values) {
  if (!isTable(values) || !Object.values(values).every(isTable)) return false;
  const { model, floor } = values;
  const isKnown = findGroup("model", model?.name) && (!floor || findGroup("floor", floor.name));
  return Boolean(isKnown) && entriesOf(values).every(([field, value]) => (field.kind === "list"
    ? [value].flat().every((item) => typeof item === "number") : typeof value === typeof field.default));
}

/** Take over the source of a case, or all of it. */
export function takeValues(values) {
  const { model = { name: about.models[0].name }, floor, ...rest } = values;
  const clear = (groups) => groups.flatMap(({ fields }) => fields)
    .forEach(({ group }) => delete state.values[group]);
  clear(sourceGroups());
  state.model = model.name;
  if (floor) choose("floor", floor.name);
  if (floor || rest.room) {
    state.floor = floor?.name ?? "plate";
    if (hasRoom()) state.room = Boolean(rest.room);
    clear(floorGroups());
  }
  if (rest.unknowns) state.unknowns[model.name] = rest.unknowns;
  for (const [field, value] of entriesOf(rest)) {
    if (value !== null) setValue(field, field.kind === "list" ? [value].flat() : value);
  }
}

/** Choose a model or a floor; its values replace those of the old one that were not changed. */
function choose(part, name) {
  const valuesOf = (kind) => entriesOf(factsOf(part, kind).values);
  for (const [field, value] of valuesOf(state[part]))
    if (isSame(valueOf(field), value)) setValue(field, defaultOf(field));
  for (const [field, value] of valuesOf(name)) setValue(field, value);
  state[part] = name;
}

/** Return whether the floor has a plate that radiates into a room. */
const hasRoom = () => factsOf("floor", state.floor).has_room;
/** The room remains chosen while a floor has none. */
const showsRoom = () => state.room && hasRoom();

// ---- Constructions.

/** Return the fields that a construction fills: those of its floor and of the ceiling. */
const filledFields = (construction) => findGroup("floor", construction.floor).fields;
const ceilingFields = () =>
  findGroup("room", "room").fields.filter(({ name }) => name.startsWith("ceiling_"));
const hasCeiling = ({ room }) => Object.keys(room).length > 0;

/** Choose the construction whose values the form has, if any, and return it. */
function findConstruction() {
  const { floor } = state;
  const equal = about.constructions.filter((entry) => entry.floor === floor
    && haveValues(filledFields(entry), { [floor]: entry.keys })
    && (showsRoom() ? haveValues(ceilingFields(), { room: entry.room }) : !hasCeiling(entry)));
  const construction = equal.find(({ name }) => name === state.chosen) ?? equal[0];
  if (construction) state.chosen = construction.name;
  return construction;
}

/** Fill the fields of floor and ceiling by a construction; a ceiling needs the room below. */
export function fillConstruction(name) {
  const construction = about.constructions.find((entry) => entry.name === name);
  if (!construction) return;
  const { floor, keys, room } = construction;
  Object.assign(state, { chosen: name, floor, room: state.room || hasCeiling(construction) });
  for (const [fields, values] of [[filledFields(construction), keys], [ceilingFields(), room]])
    for (const field of fields) setValue(field, values[field.name] ?? defaultOf(field));
}

// ---- Form.

/** Build the form of the current door. Of the handlers, `onChange` is called after each change,
 * `onTyping` while one is typed, `onInvalid` if it is no value, `onPress` with a press curve. */
export function buildInputs(handlers) {
  const { onChange } = handlers;
  const { id: focus, selectionStart: caret } = document.activeElement;
  const scroll = byId("inputs").scrollTop;
  const all = { ...handlers, rebuild: () => { buildInputs(handlers); onChange(); } };
  replaceInputs(state.door === "floor" ? floorInputs(all) : ballInputs(all));
  byId("inputs").scrollTop = scroll;
  if (!focus || document.activeElement.id === focus) return;
  byId(focus)?.focus();
  // A text that is being typed goes on.
  if (caret != null) byId(focus)?.setSelectionRange(caret, caret);
}

/** Replace the form but for a choice that has the focus: typing its name goes on. */
function replaceInputs(children) {
  const form = byId("inputs");
  const focused = form.querySelector(":scope > .choice select:focus");
  const at = children.findIndex((child) => child.querySelector?.(`#${focused?.id}`));
  if (!focused || at < 0) { form.replaceChildren(...children); return; }
  const kept = focused.closest(".choice");
  for (const child of [...form.childNodes]) if (child !== kept) child.remove();
  kept.before(...children.slice(0, at));
  kept.after(...children.slice(at + 1));
  const { value } = children[at].querySelector("select");
  if (focused.value !== value) focused.value = value;
  for (const help of kept.querySelectorAll(":scope > .help")) help.remove();
  kept.append(...children[at].querySelectorAll(":scope > .help"));
}

/** Return whether fields have the values of a case or, where it states none, their defaults. */
const haveValues = (fields, values) => fields.every((field) =>
  isSame(valueOf(field), values[field.group]?.[field.name] ?? defaultOf(field)));

function ballInputs(handlers) {
  const common = commonGroups();
  const own = findGroup("model", state.model);
  return [
    kindInput("model", "Model", about.models, handlers), pressInputs(handlers.onPress),
    ...[...common.slice(0, 2), own, ...common.slice(2)].map((group) => groupElement(group, handlers)),
    foldedElement([own, ...common], handlers),
  ];
}

/** Return the choice of a model or a floor, and what it is for. */
function kindInput(part, label, kinds, handlers) {
  const { purpose, validity } = factsOf(part, state[part]);
  const select = (name) => { choose(part, name); handlers.rebuild(); };
  return choiceOf(part, label, kinds.map(({ name, title }) => [name, title]), state[part], select,
    element("p", { class: "help" }, `${purpose}. `, element("em", {}, validity)));
}

function floorInputs(handlers) {
  const construction = findConstruction();
  const kinds = Map.groupBy(about.constructions, ({ kind }) => kind);
  const options = [...kinds].map(([kind, entries]) => [kind, entries.map(({ name }) => [name, name])]);
  const sources = construction?.sources ?? {};
  const [room] = groupsOf("room");
  const isRequirement = ({ name }) => ["required", "rating"].includes(name);
  const fieldsOfRoom = (title, isOwn) => (showsRoom()
    ? groupElement({ ...room, title, fields: room.fields.filter(isOwn) }, handlers, sources) : "");
  const box = element("input", { type: "checkbox", id: "has_room" });
  box.checked = showsRoom();
  box.disabled = !hasRoom();
  box.addEventListener("change", () => { state.room = box.checked; handlers.rebuild(); });
  return [
    choiceOf("construction", "Construction", [["", "None of the library"], ...options],
      construction?.name ?? "", (name) => { fillConstruction(name); handlers.rebuild(); },
      element("p", { class: "help", id: "construction_text" }, textOfConstruction(construction))),
    fieldsOfRoom("Requirement", isRequirement),
    kindInput("model", "Dropped on it", about.models, handlers),
    element("label", { class: "toggle" }, box, "Room below"),
    fieldsOfRoom(room.title, (field) => !isRequirement(field)),
    kindInput("floor", "Kind of floor", about.floors.filter(({ name }) => name !== "rigid"), handlers),
    groupElement(findGroup("floor", state.floor), handlers, sources),
    foldedElement(floorGroups(), handlers, sources),
  ];
}

const textOfConstruction = (entry) => entry?.text ?? "Changed values of a floor.";

function choiceOf(id, label, options, value, onSelect, ...rest) {
  const input = select({ id }, options, value);
  input.addEventListener("change", () => onSelect(input.value));
  return element("div", { class: "choice" }, fieldRow(id, element("b", {}, label), input), ...rest);
}

const titleOf = ({ part, name, title }) =>
  (["model", "floor"].includes(part) ? factsOf(part, name).title : title);

/** Return the element of the fields of a group, empty without any; `sources` are of their values. */
function groupElement(group, handlers, sources, advanced = false) {
  const fields = group.fields.filter((field) => isUsed(field) && field.advanced === advanced)
    .map((field) => fieldElement(field, handlers, sources?.[field.name]));
  return fields.length ? element("fieldset", {}, element("legend", {}, titleOf(group)), ...fields) : "";
}

let isUnfolded = false;

/** Return the element of the folded fields of groups. */
function foldedElement(groups, handlers, sources) {
  const parts = groups.map((group) => groupElement(group, handlers, sources, true)).filter(Boolean);
  const titles = parts.map((part) => part.querySelector("legend").textContent.toLowerCase());
  // The event of a click on it may come after that of a field.
  isUnfolded = byId("more")?.open ?? isUnfolded;
  const result = element("details", { id: "more", open: isUnfolded, class: "folded" },
    element("summary", {}, `More: ${titles.join(", ")}`), ...parts);
  result.addEventListener("toggle", () => { isUnfolded = result.open; });
  return result;
}

function fieldElement(field, handlers, source) {
  const id = `${field.group}.${field.name}`;
  const onInput = (value) => {
    const used = () => allFields().map(isUsed).join();
    const before = used();
    setValue(field, value);
    const { activeElement } = document;
    if (used() === before) handlers.onChange();
    else if (activeElement.type !== "range") handlers.rebuild();
    // A slider is dragged to its end first.
    else activeElement.addEventListener("change", handlers.rebuild, { once: true });
    showConstruction();
  };
  const { kind, label, unit, help } = field;
  const newInputs = { real: numberInput, whole: numberInput, list: listInput }[kind] ?? plainInput;
  const inputs = newInputs(field, id, onInput, handlers);
  for (const input of inputs) input.setAttribute("aria-describedby", `${id}.help ${id}.error`);
  const texts = [`${help}.`];
  if (kind === "list") texts.push("Blanks or semicolons separate values; 24,5 is 24.5.");
  if (source) texts.push(`Source of the value: ${source}.`);
  return fieldRow(id, unit ? `${label}, ${unit}` : label, ...inputs,
    element("p", { class: "help", id: `${id}.help` }, texts.join(" ")),
    element("p", { class: "error", id: `${id}.error` }));
}

/** Show which construction the form has. */
function showConstruction() {
  if (!byId("construction")) return;
  const construction = findConstruction();
  byId("construction").value = construction?.name ?? "";
  byId("construction_text").textContent = textOfConstruction(construction);
}

/** Return the input of a choice, a flag or a text. */
function plainInput({ kind, choices, ...field }, id, onInput) {
  const options = Object.entries(choices).map(([value, text]) => [value, capitalize(text)]);
  const input = kind === "choice" ? select({ id }, options)
    : element("input", { id, type: kind === "flag" ? "checkbox" : "text" });
  const property = kind === "flag" ? "checked" : "value";
  input[property] = valueOf(field);
  input.addEventListener("change", () => onInput(input[property]));
  return [input];
}

/** Call a function when an input is left, with true, and after a pause of typing, with false. */
export function listenToTyping(input, act) {
  let timer = 0;
  input.addEventListener("input", () => {
    clearTimeout(timer);
    timer = setTimeout(() => { if (input.isConnected) act(false); }, TYPING_PAUSE);
  });
  for (const name of ["change", "blur"]) input.addEventListener(name, () => {
    clearTimeout(timer);
    if (input.isConnected) act(true);
  });
}

/** Return whether a field of the form has a text that is not its value. */
export const isTyping = () => Boolean(document.querySelector("#inputs [data-typed]"));

/** Take over what is typed into an input: `read` returns its value, undefined if it has none. */
function takeTyping(input, { read, isTaken, send, show, problem }, { onTyping, onInvalid }) {
  input.addEventListener("input", () => {
    input.toggleAttribute("data-typed", !isTaken());
    input.removeAttribute("aria-invalid");
    onTyping();
  });
  listenToTyping(input, (isLeft) => {
    if (!input.hasAttribute("data-typed")) { if (isLeft) show(); return; }
    const value = read(input.value);
    if (value === undefined) {
      if (isLeft && !input.ariaInvalid) onInvalid(input.id, problem(input.value));
      return;
    }
    input.removeAttribute("data-typed");
    send(value, isLeft);
  });
}

function listInput(field, id, onInput, handlers) {
  const textOf = () => [valueOf(field)].flat().join(" ");
  const text = element("input", { id, type: "text", value: textOf(), placeholder: "such as 10 20" });
  const show = () => { text.value = textOf(); };
  const read = (list) => {
    const numbers = list.trim().split(/\s*;\s*|,?\s+/).filter(Boolean).map(numberOf);
    return numbers.some(Number.isNaN) ? undefined : numbers;
  };
  takeTyping(text, {
    read, show, isTaken: () => isSame(read(text.value), [valueOf(field)].flat()),
    send: (numbers, isLeft) => { onInput(numbers); if (isLeft) show(); },
    problem: (list) =>
      `${field.label}: “${list}” is not a list of numbers; blanks or semicolons separate them`,
  }, handlers);
  return [text];
}

function numberInput(field, id, onInput, handlers) {
  let current = scaled(valueOf(field), -field.power);
  // A zero that is not a number, such as "none", is an empty field.
  const { zero } = field;
  const textOf = (value) => (zero && value === 0 ? "" : String(Number(value.toPrecision(DIGITS))));
  const number = element("input", {
    id, type: "text", inputmode: "decimal", value: textOf(current), placeholder: zero,
    class: `number${zero ? " open" : ""}`,
  });
  const take = (entered) => {
    current = entered;
    slider?.moveTo(entered);
  };
  const send = (entered) => {
    number.removeAttribute("data-typed");
    number.value = textOf(entered);
    take(entered);
    onInput(scaled(entered, field.power));
  };
  const read = (text) => {
    const entered = zero && !text.trim() ? 0 : numberOf(text);
    return Number.isNaN(entered) ? undefined : entered;
  };
  const { step } = field;
  const slider = field.slider && step ? sliderInput(field, current, send) : null;
  takeTyping(number, {
    read, isTaken: () => number.value === textOf(current) || read(number.value) === current,
    show: () => { number.value = textOf(current); },
    // The text remains as it is while it is typed.
    send: (entered, isLeft) => {
      if (isLeft) { send(entered); return; }
      take(entered);
      onInput(scaled(entered, field.power));
    },
    problem: (text) => `${field.label}: ${numberProblem(text, field.unit)}`,
  }, handlers);
  number.addEventListener("keydown", (event) => {
    const steps = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!steps || !step || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    // To the next round number.
    const ratio = (read(number.value) ?? current) / step;
    const last = steps > 0 ? Math.floor(ratio + 1e-6) : Math.ceil(ratio - 1e-6);
    const next = rounding(last + steps, step);
    if (next >= (field.lower ?? -Infinity) && next <= (field.upper ?? Infinity)) send(next);
  });
  return slider ? [number, slider] : [number];
}

/** Return a whole number of steps, a power of ten, without errors of rounding. */
const rounding = (count, step) => scaled(Math.round(count), Math.round(Math.log10(step)));

/** Return a slider of round values; `onMove` is called with the selected value. */
function sliderInput(field, value, onMove) {
  const { group, name, slider: { ends }, step, lower, upper, label, unit } = field;
  // A model or a construction may have brought a value near the end for the default.
  const low = Math.min(ends[0], Math.max(value / 2, lower ?? 0));
  const high = Math.max(ends[1], Math.min(2 * value, upper ?? Infinity));
  const min = rounding(Math.ceil(low / step - 1e-6), step);
  const max = rounding(Math.floor(high / step + 1e-6), step);
  const id = `${group}.${name}.slider`;
  const slider = element("input", { id, type: "range", "aria-label": label, min, max, step });
  slider.moveTo = (selected) => {
    slider.value = selected;
    slider.setAttribute("aria-valuetext", `${selected} ${unit}`.trim());
  };
  slider.moveTo(value);
  slider.addEventListener("input", () => onMove(Number(slider.value)));
  return slider;
}

/** Return the first field with an error, or null. */
export const invalidField = () => document.querySelector("#inputs [aria-invalid]");

/** Mark only one field as invalid, with a sentence below it; none without a name. */
export function markField(name, message = "") {
  for (const input of document.querySelectorAll("#panel [aria-invalid]"))
    input.removeAttribute("aria-invalid");
  for (const error of document.querySelectorAll("#panel .error")) error.textContent = "";
  const input = name && (byId(name) ?? byId(`recording_${name}`));
  if (!input) return;
  const folded = input.closest("details:not([open])");
  if (folded) {
    folded.open = true;
    input.focus();
  }
  input.setAttribute("aria-invalid", "true");
  const error = byId(`${input.id}.error`);
  if (error) error.textContent = message;
}
