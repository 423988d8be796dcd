// Sentences about fits and changes, from the codes and values of the server.
import { capitalize, rounded, signed } from "thud/page.js";
import { findField } from "thud/form.js";
import { keyValue, shownValue } from "thud/variants.js";

// Why there is no change, by the code of the reason.
const REASONS = {
  no_parameter: "No change of a single parameter makes the source conform: each was tried from half "
    + "to twice its value in steps of 6 %.",
  no_parameters: "This model has no parameters to change.",
  no_layer: "No change of a single layer meets the requirement: each was tried in steps up to twice "
    + "its thickness or a fifth of its stiffness.",
  other_source: "No floor meets the requirement with this source, see the warnings. Choose another "
    + "source.",
};
/** What holds for the changes of a door. */
export const CHANGE_NOTES = {
  ball: "Changes conform by this model, with its numerical error; some are close to a limit.",
  floor: "Each layer alone; the level need not fall with each step, as modes of the room move. A "
    + "requirement is met if its probability is at least 84 %.",
};

const levelText = ({ level, uncertainty, probability }) =>
  `${level} dB, standard uncertainty ${uncertainty.toFixed(1)} dB, met with `
  + `${(100 * probability).toFixed(0)} %`;

/** Return a change of a case with values, and the level that it reaches. */
export function changeText({ key, value, factor, ...reached }, values) {
  const percent = signed(100 * (factor - 1), "%");
  const start = shownValue(key, keyValue(values, key));
  const text = `${findField(...key.split(".")).label} ${shownValue(key, value)} instead of ${start} `;
  return `${text}(${percent}\u00a0%)${"level" in reached ? `: ${levelText(reached)}` : ""}`;
}

/** Return why there is no change, and constructions that meet a requirement. */
export function noChangeText({ reason, constructions }) {
  const names = constructions.map(({ name, ...reached }) => `${name}: ${levelText(reached)}`);
  const known = "Constructions of the library on the same structural floor that meet it";
  return `${REASONS[reason]}${names.length ? ` ${known}: ${names.join("; ")}.` : ""}`;
}

/** Return the result of a fit with its intervals, and how well it fits. */
export function fitText({ file, intervals, values, residual: [size, part], is_explained: fits }) {
  const texts = intervals.map(([key, ...ends]) => {
    const [group, name] = key.split(".");
    const { label, unit } = findField(group, name);
    const [best, low, high] = [values[group][name], ...ends].map((value) =>
      (value === null ? null : shownValue(key, value, false)));
    const range = low === null || high === null ? "not determined" : `${low} to ${high}`;
    return `${label.replace(/^[A-Z](?!\w*')/, (letter) => letter.toLowerCase())} ${best} (${range}) ${unit}`;
  });
  return `Fitted to ${file}: ${texts.map((text) => text.trim()).join(", ")} (95\u00a0%). The model `
    + `${fits ? "explains" : "does not explain"} the data; the largest residual is `
    + `${rounded(size, "N")}, ${(100 * part).toPrecision(2)}\u00a0% of the largest force. `
    + "The verdict is that of the best values, not of their intervals.";
}

/** Return notes as sentences. */
export const sentences = (notes) => notes.map((note) => `${capitalize(note)}.`).join(" ");
