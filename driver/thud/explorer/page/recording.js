// The door of a recording: its files, what they do not say, and what its answer asks for.
import { button, byId, element, fileZone, numberOf, numberProblem } from "./page.js";
import { about, buildInputs, listenToTyping, state } from "./form.js";
import { ServerError } from "./request.js";

/** Files of the recording, drops of one measurement. */
export const recording = { files: [] };
/** What the answer asks for, between the files and the other fields. */
const asked = element("div", { id: "asks", role: "group", "aria-label": "Missing values", hidden: true });

/** Return what is stated, numbers as the server reads them, and the files. */
export function recordingRequest() {
  const values = Object.fromEntries(about.recording.filter(({ name }) => name in state.recording).map(({ name, kind }) => {
    const number = kind === "number" ? numberOf(state.recording[name]) : NaN;
    return [name, Number.isNaN(number) ? state.recording[name] : String(number)];
  }));
  return { values, files: recording.files };
}

/** Take over the text of a field, and show it in its inputs but for the one in which it was typed. */
function setStated(name, text, source) {
  if (text.trim()) state.recording[name] = text;
  else delete state.recording[name];
  state.earlier = state.earlier.filter((other) => other !== name);
  for (const id of [`recording_${name}`, `ask_${name}`]) {
    const input = byId(id);
    if (input && input !== source) input.value = text;
  }
  showEarlier();
}

/** Say that what is stated belongs to an earlier recording, whose files are gone. */
export function keepStated() {
  state.earlier = Object.keys(state.recording);
}

/** Build the form of the recording; `onChange` is called when it has to be assessed again, `onTyping` while a field is typed. */
function buildRecording(handlers) {
  const { onChange } = handlers;
  const fields = (folded) => about.recording.filter((field) => field.folded === folded).map((field) => recordingField(field, handlers));
  byId("inputs").replaceChildren(
    fileZone({ id: "drop_zone", input: "file", title: "Drop the files of a force plate here", label: "Choose files", multiple: true },
      element("p", { class: "help" }, "One file, or the drops of one measurement: WAV, FLAC, CSV, HDF5, UFF 58, MATLAB or TDMS; with it the laboratory’s TOML file"), (files) => addFiles(files, onChange)),
    element("ul", { id: "files", "aria-label": "Files" }), asked,
    element("fieldset", {}, element("legend", {}, "What the file does not say"), element("p", { id: "earlier", class: "help" }), ...fields(false)),
    element("details", { class: "folded" }, element("summary", {}, "Uncertainties, filter, report"), ...fields(true)));
  showFiles(onChange);
  showEarlier(handlers);
}

let clearEarlier = null;

/** Show which values were stated for an earlier recording, and a button to clear them. */
function showEarlier(handlers) {
  if (handlers) clearEarlier = () => {
    for (const name of state.earlier) delete state.recording[name];
    state.earlier = [];
    buildRecording(handlers);
    byId("recording_height").focus();
    handlers.onChange();
  };
  const labels = about.recording.filter(({ name }) => state.earlier.includes(name)).map(({ label, name }) => `${label}: ${state.recording[name]}`);
  byId("earlier").hidden = !labels.length;
  byId("earlier").replaceChildren(`Kept from the last recording: ${labels.join("; ")}. `, button("Clear", clearEarlier, { id: "clear_earlier" }));
}

export function addFiles(files, onChange) {
  recording.files = [...recording.files, ...files];
  showFiles(onChange);
  onChange();
}

/** Return whether a file is that of the laboratory, not a record. */
export const isLaboratory = ({ name }) => /\.toml$/i.test(name);

function showFiles(onChange) {
  byId("files")?.replaceChildren(...recording.files.map((file) => element("li", {}, isLaboratory(file) ? `${file.name} (laboratory)` : file.name,
    button("×", () => {
      recording.files = recording.files.filter((other) => other !== file);
      if (!recording.files.length) keepStated();
      showEarlier();
      showFiles(onChange);
      byId("file").focus();
      onChange();
    }, { class: "remove", "aria-label": `Remove ${file.name}` }))));
}

function recordingField({ name, label, kind, hint, choices }, { onChange, onTyping }) {
  const id = `recording_${name}`;
  const options = Object.entries({ "": "not known", ...choices }).map(([value, text]) => element("option", { value }, text));
  const isNumber = kind === "number";
  const input = kind === "choice" ? element("select", { id }, ...options)
    : element("input", { id, type: "text", placeholder: hint, class: isNumber && "number", inputmode: isNumber && "decimal", "aria-describedby": `${id}.error` });
  input.value = state.recording[name] ?? "";
  // A file may be dropped while the field still has the focus.
  input.addEventListener("input", () => { setStated(name, input.value, input); onTyping(); });
  listenToTyping(input, (isLeft) => {
    const isValue = !isNumber || !input.value.trim() || !Number.isNaN(numberOf(input.value));
    if (isLeft || isValue) onChange();
  });
  return element("div", { class: "field" }, element("label", { for: id }, label), input, element("p", { class: "error", id: `${id}.error` }));
}

/** Return the body of a request with the files and fields; throw ServerError for one that the server would refuse. */
export function recordingBody(values) {
  const { values: stated, files } = recordingRequest();
  const body = new FormData();
  if (values) body.set("case", JSON.stringify(values));
  for (const { name, label, kind } of about.recording.filter((field) => field.name in stated)) {
    if (kind === "number" && Number.isNaN(numberOf(stated[name]))) throw new ServerError({ error: `${label}: ${numberProblem(stated[name])}`, field: name });
    body.set(name, stated[name]);
  }
  for (const file of files) {
    if (file.size > about.max_recording) throw new ServerError({ error: `${file.name} is larger than ${about.max_recording / 1e6} MB; allowed: less` });
    body.append("file", file);
  }
  return body;
}

/** Ask for what the answer lacks, with the values that it found or that were typed since; one button sends all. */
export function showAsks(asks, { onChange, onTyping }) {
  const focus = asked.contains(document.activeElement) ? document.activeElement.id : "";
  // The last answer stands above on narrow screens.
  if (!asked.hidden && !asks.length && matchMedia("(max-width: 759px)").matches) scrollTo(0, 0);
  asked.hidden = !asks.length;
  const cards = asks.map(({ reason, values }) => {
    const fields = Object.keys(values).map((name) => about.recording.find((field) => field.name === name)).filter(Boolean);
    const inputs = fields.map(({ name, label, kind, hint }) => {
      const id = `ask_${name}`;
      const isNumber = kind === "number";
      const input = element("input", { id, name, type: "text", placeholder: hint, class: isNumber && "number", inputmode: isNumber && "decimal", value: state.recording[name] ?? values[name] });
      input.addEventListener("input", () => { setStated(name, input.value, input); onTyping(); });
      return element("div", { class: "field" }, element("label", { for: id }, label), input);
    });
    return element("div", {}, reason ? element("p", {}, reason) : "", ...inputs);
  });
  const send = () => {
    for (const { name, value } of asked.querySelectorAll("input")) setStated(name, value);
    onChange();
  };
  asked.replaceChildren(...cards, ...(cards.length ? [button("Assess with this", send, { class: "strong", type: "submit", id: "assess" })] : []));
  // After Enter the next value is missing.
  if (focus) (byId(focus) ?? asked.querySelector("input"))?.focus();
}

/** Build the inputs of the current door. */
export function buildDoor(handlers) {
  if (state.door === "recording") buildRecording(handlers);
  else buildInputs(handlers);
}
