// The door of a recording: its files, what they do not say, and what its answer asks for.
import {
  button, byId, element, fieldRow, fileZone, numberOf, numberProblem, scaled, select,
} from "thud/page.js";
import { about, buildInputs, listenToTyping, state } from "thud/form.js";
import { ServerError } from "thud/request.js";

const FILES_HELP = "One file, or the drops of one measurement: WAV, FLAC, CSV, HDF5, UFF 58, "
  + "MATLAB or TDMS; with it the laboratory’s TOML file";

// Why values are asked for, by code.
const REASONS = {
  plate_rings: (frequency) => `The force plate rings at ${frequency} Hz after the contact, which `
    + "changes levels up to 500 Hz. State its resonance; the values are estimates from the record.",
  share_assumed: (level) => `${level} depends on the share of the resonance in the static response `
    + "of the plate: 1 if no other mode is as stiff, else less. Taps with hammers of different "
    + "hardness show it.",
  missing: () => "Without drop height and mass of the source these criteria are undecided, and the "
    + "restitution is known only if the file holds bounces.",
};

/** Files of the recording, drops of one measurement. */
export const recording = { files: [] };
/** What the answer asks for, between the files and the other fields. */
const asked = element("div", { id: "asks", role: "group", "aria-label": "Missing values", hidden: true });

const statedFields = () => about.recording.filter(({ name }) => name in state.recording);

/** Return what is stated as a table of the configuration of a recording; NaN for no number. */
export function statedTable() {
  const table = {};
  for (const { name, path, kind, unit } of statedFields()) {
    const text = state.recording[name];
    const value = kind === "number" ? scaled(numberOf(text), unit === "%" ? -2 : 0) : text;
    if (path.length > 1) (table[path[0]] ??= {})[path[1]] = value;
    else table[name] = value;
  }
  return table;
}

/** Take over the text of a field, and show it in its other inputs. */
function setStated(name, text, source) {
  if (text.trim()) state.recording[name] = text;
  else delete state.recording[name];
  for (const id of [`recording_${name}`, `ask_${name}`]) {
    const input = byId(id);
    if (input && input !== source) input.value = text;
  }
}

/** Build the form of the recording; its handlers are those of `buildInputs`. */
function buildRecording(handlers) {
  const { onChange } = handlers;
  const fields = (folded) => about.recording.filter((field) => field.folded === folded)
    .map((field) => recordingField(field, handlers));
  byId("inputs").replaceChildren(
    fileZone(
      { id: "drop_zone", input: "file", title: "Drop the files of a force plate here", multiple: true },
      FILES_HELP, (files) => addFiles(files, onChange)),
    element("ul", { id: "files", "aria-label": "Files" }), asked,
    element("fieldset", {}, element("legend", {}, "What the file does not say"),
      ...fields(false)),
    // Values that are kept of an earlier recording are in sight.
    element("details", { class: "folded", open: statedFields().some(({ folded }) => folded) },
      element("summary", {}, "Uncertainties, filter, report"), ...fields(true)));
  showFiles(onChange);
}

export function addFiles(files, onChange) {
  recording.files = [...recording.files, ...files];
  showFiles(onChange);
  onChange();
}

/** Return whether a file is that of the laboratory, not a record. */
export const isLaboratory = ({ name }) => /\.toml$/i.test(name);

function showFiles(onChange) {
  byId("files")?.replaceChildren(...recording.files.map((file) => element("li", {},
    isLaboratory(file) ? `${file.name} (laboratory)` : file.name, button("×", () => {
      recording.files = recording.files.filter((other) => other !== file);
      showFiles(onChange);
      byId("file").focus();
      onChange();
    }, { class: "remove", "aria-label": `Remove ${file.name}` }))));
}

/** Return the input of a field with its text; what is typed is stated at once. */
function newInput(id, { name, kind, hint, choices }, value, onTyping) {
  const isNumber = kind === "number";
  const input = kind === "choice" ? select({ id }, Object.entries({ "": "not known", ...choices }))
    : element("input", { id, name, type: "text", placeholder: hint, class: isNumber && "number",
      inputmode: isNumber && "decimal", "aria-describedby": `recording_${name}.error` });
  input.value = value ?? "";
  // A file may be dropped while the field still has the focus.
  input.addEventListener("input", () => { setStated(name, input.value, input); onTyping(); });
  return input;
}

function recordingField(field, { onChange, onTyping }) {
  const { name, label, kind } = field;
  const id = `recording_${name}`;
  const input = newInput(id, field, state.recording[name], onTyping);
  listenToTyping(input, (isLeft) => {
    const isNoNumber = kind === "number" && Number.isNaN(numberOf(input.value));
    if (isLeft || !isNoNumber || !input.value.trim()) onChange();
  });
  return fieldRow(id, label, input, element("p", { class: "error", id: `${id}.error` }));
}

/** Return the body of a request; throw ServerError for one that the server would refuse. */
export function recordingBody(values) {
  const body = new FormData();
  body.set("table", JSON.stringify(statedTable()));
  if (values) body.set("case", JSON.stringify(values));
  const refuse = (error, field) => { throw new ServerError({ error, field }); };
  for (const { name, label, kind } of statedFields()) {
    const text = state.recording[name];
    if (kind === "number" && Number.isNaN(numberOf(text)))
      refuse(`${label}: ${numberProblem(text)}`, name);
  }
  const limit = about.max_recording;
  for (const file of recording.files) {
    if (file.size > limit) refuse(`${file.name} is larger than ${limit / 1e6} MB; allowed: less`);
    body.append("file", file);
  }
  return body;
}

/** Ask for what the answer lacks, with the values that it found or that were typed since. */
export function showAsks(asks, { onChange, onTyping }) {
  const focus = asked.contains(document.activeElement) ? document.activeElement.id : "";
  // The last answer stands above on narrow screens.
  if (!asked.hidden && !asks.length && matchMedia("(max-width: 759px)").matches) scrollTo(0, 0);
  asked.hidden = !asks.length;
  const rowOf = ([name, value]) => {
    const field = about.recording.find((other) => other.name === name);
    const id = `ask_${name}`;
    return fieldRow(id, field.label, newInput(id, field, state.recording[name] ?? value, onTyping));
  };
  const cards = asks.map(({ code, subject, values }) => element("div", {},
    code ? element("p", {}, REASONS[code](subject)) : "", ...Object.entries(values).map(rowOf)));
  const send = () => {
    for (const { name, value } of asked.querySelectorAll("input")) setStated(name, value);
    onChange();
  };
  const sending = button("Assess with this", send, { class: "strong", type: "submit", id: "assess" });
  asked.replaceChildren(...cards, ...(cards.length ? [sending] : []));
  // After Enter the next value is missing.
  if (focus) (byId(focus) ?? asked.querySelector("input"))?.focus();
}

/** Build the inputs of the current door. */
export function buildDoor(handlers) {
  if (state.door === "recording") buildRecording(handlers);
  else buildInputs(handlers);
}
