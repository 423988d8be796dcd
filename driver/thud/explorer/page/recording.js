// The door of a recording: its files, what they do not say, and what its answer asks for.
import { button, byId, element } from "./page.js";
import { about, buildInputs, state } from "./form.js";

/** Files of the recording, drops of one measurement. */
export const recording = { files: [] };
/** What the answer asks for, between the files and the other fields. */
const asked = element("div", { id: "asks", role: "group", "aria-label": "Missing values", hidden: true });

/** Build the form of the recording; `onChange` is called when it has to be assessed again. */
export function buildRecording(onChange) {
  const fields = (folded) => about.recording.filter((field) => field.folded === folded).map((field) => recordingField(field, onChange));
  byId("inputs").replaceChildren(
    element("div", { id: "drop_zone", class: "drop_zone" }, element("b", {}, "Drop the files of a force plate here"), fileInput(onChange), element("label", { for: "file" }, "Choose files"),
      element("p", { class: "help" }, "One file, or the drops of one measurement: WAV, FLAC, CSV, HDF5, UFF 58, MATLAB or TDMS; with it the laboratory’s TOML file")),
    element("ul", { id: "files", "aria-label": "Files" }), asked,
    element("fieldset", {}, element("legend", {}, "What the file does not say"), ...fields(false)),
    element("details", { class: "folded" }, element("summary", {}, "Uncertainties, filter, report"), ...fields(true)));
  showFiles(onChange);
}

function fileInput(onChange) {
  const input = element("input", { type: "file", id: "file", class: "file", multiple: true });
  input.addEventListener("change", () => {
    addFiles([...input.files], onChange);
    // Otherwise choosing the same file again would raise no event.
    input.value = "";
  });
  return input;
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
      showFiles(onChange);
      byId("file").focus();
      onChange();
    }, { class: "remove", "aria-label": `Remove ${file.name}` }))));
}

function recordingField({ name, label, kind, hint, choices }, onChange) {
  const id = `recording_${name}`;
  const options = Object.entries({ "": "not known", ...choices }).map(([value, text]) => element("option", { value }, text));
  const isNumber = kind === "number";
  const input = kind === "choice" ? element("select", { id }, ...options)
    : element("input", { id, type: isNumber ? "number" : "text", step: isNumber && "any", "aria-describedby": `${id}.error` });
  input.value = state.recording[name] ?? "";
  // A file may be dropped while the field still has the focus.
  input.addEventListener("input", () => {
    if (input.value) state.recording[name] = input.value;
    else delete state.recording[name];
  });
  input.addEventListener("change", () => { if (recording.files.length) onChange(); });
  return element("div", { class: "field" }, element("label", { for: id }, label + hint), input, element("p", { class: "error", id: `${id}.error` }));
}

/** Return the body of a request with the files and fields. */
export function recordingBody(values) {
  const body = new FormData();
  if (values) body.set("case", JSON.stringify(values));
  for (const [name, value] of Object.entries(state.recording)) body.set(name, value);
  for (const file of recording.files) body.append("file", file);
  return body;
}

/** Ask for what the answer lacks, with the values that it found; one button sends all, and what was typed stays. */
export function showAsks(asks, onChange) {
  const open = (asks ?? []).filter(({ values }) => Object.keys(values).some((name) => !state.recording[name]));
  const focus = asked.contains(document.activeElement) ? document.activeElement.id : "";
  asked.hidden = !open.length;
  const cards = open.map(({ reason, values }) => {
    const fields = Object.keys(values).map((name) => about.recording.find((field) => field.name === name)).filter(Boolean);
    const inputs = fields.map(({ name, label, kind, hint }) => {
      const id = `ask_${name}`;
      const value = String(state.recording[name] ?? values[name]);
      const input = element("input", { id, name, type: kind, step: kind === "number" && "any", value });
      const old = byId(id);
      if (old?.defaultValue === value) input.value = old.value;
      return element("div", { class: "field" }, element("label", { for: id }, label + hint), input);
    });
    return element("div", {}, reason ? element("p", {}, reason) : "", ...inputs);
  });
  const send = () => {
    for (const { name, value } of asked.querySelectorAll("input")) {
      if (value) state.recording[name] = value;
      byId(`recording_${name}`).value = state.recording[name] ?? "";
    }
    onChange();
  };
  asked.replaceChildren(...cards, ...(cards.length ? [button("Assess with this", send, { class: "strong", type: "submit", id: "assess" })] : []));
  // After Enter the next value is missing.
  if (focus) (byId(focus) ?? asked.querySelector("input"))?.focus();
}

/** Build the inputs of the current door. */
export function buildDoor(handlers) {
  if (state.door === "recording") buildRecording(handlers.onChange);
  else buildInputs(handlers);
}
