// Variants: what they are called, by what differs, and their table.
import { button, capitalize, element, fillTable, minus, scaled, signed } from "thud/page.js";
import { STYLES, swatch } from "thud/plot.js";
import { VERDICTS, headlineText } from "thud/headline.js";
import { about, defaultOf, factsOf, findField } from "thud/form.js";

// Words of keys in names, if shorter than their labels.
const WORDS = {
  "ball.youngs_modulus": "E", "ball.wall_thickness": "wall", "ball.outer_radius": "radius",
  "drop.height": "drop", "plate.thickness": "slab", "room.reverberation_time": "T",
};
// Number of differences in a name.
const MAX_DIFFERENCES = 3;

/** Return a free style for a further variant. */
export function freeStyle(variants) {
  const used = variants.map(({ style }) => style);
  for (let style = 1; style < STYLES; style += 1) if (!used.includes(style)) return style;
  return 1 + (variants.length % (STYLES - 1));
}

/** Give each variant its label: a name of the user, of the file, or what it is and what differs from the others. */
export function nameVariants(variants) {
  const models = variants.filter(({ values }) => values);
  const described = models.map(describe);
  const isShared = new Set(described.map(({ base }) => base)).size === 1 && models.length > 1;
  const keys = [...new Set(described.flatMap(({ changes }) => [...changes]))]
    .filter((key) => models.length === 1 || new Set(models.map(({ values }) => valueText(values, key))).size > 1);
  for (const [i, variant] of models.entries()) {
    const { base, changes } = described[i];
    const hasBase = !isShared || !keys.length;
    const words = keys.filter((key) => isShared || changes.has(key)).map((key) => wordsOf(key, variant.values, hasBase));
    const shown = [...(hasBase ? [base] : []), ...words.slice(0, MAX_DIFFERENCES), ...(words.length > MAX_DIFFERENCES ? ["…"] : [])];
    variant.label = variant.title ?? capitalize(shown.join(", "));
  }
  const seen = new Map();
  for (const variant of variants) {
    if (!variant.values) variant.label = variant.title ?? variant.name;
    const count = (seen.get(variant.label) ?? 0) + 1;
    seen.set(variant.label, count);
    if (count > 1) variant.label += ` (${count})`;
  }
}

/** Return the model and the construction that are closest to a case, and the keys that differ. */
function describe({ values, chosen }) {
  const { model, floor } = values;
  const isFloor = (group) => Boolean(floor) && (group === floor.name || group === "room");
  const isSource = (group) => !isFloor(group) && !["model", "floor", "unknowns"].includes(group);
  const ownModel = factsOf("model", model.name);
  const source = closest(values, isSource, [{ ...ownModel, values: { model, ...ownModel.values } }]);
  if (!floor) return source;
  const constructions = about.constructions.filter((entry) => entry.floor === floor.name)
    .map((entry) => ({ title: entry.name, values: { [floor.name]: entry.keys, room: entry.room } }))
    .sort((one, other) => (other.title === chosen) - (one.title === chosen));
  const found = closest(values, isFloor, [...constructions, factsOf("floor", floor.name)]);
  const isStandard = source.base === about.models[0].title && !source.changes.size;
  return {
    base: isStandard ? found.base : `${found.base}, ${source.base.toLowerCase()}`,
    changes: new Set([...found.changes, ...source.changes]),
  };
}

/** Return the title of the first candidate with the fewest changes, and these. */
function closest(values, isOwn, candidates) {
  const keysOf = (groups) => Object.entries(groups).filter(([group]) => isOwn(group))
    .flatMap(([group, own]) => Object.keys(own).map((name) => `${group}.${name}`));
  const results = candidates.map((candidate) => {
    const keys = [...new Set([...keysOf(values), ...keysOf(candidate.values)])];
    const changes = keys.filter((key) => valueText(values, key) !== valueText(candidate.values, key));
    return { base: candidate.title, changes: new Set(changes) };
  });
  return results.sort((one, other) => one.changes.size - other.changes.size)[0];
}

/** Return the value of a key, "group.key", in values or by default. */
export function keyValue(values, key) {
  const [group, name] = key.split(".");
  return values[group]?.[name] ?? defaultOf(findField(group, name), values.model?.name);
}

const valueText = (values, key) => shownValue(key, keyValue(values, key));

/** Return the text of a value of a key, in the unit of its field. */
export function shownValue(key, value, hasUnit = true) {
  const { power = 0, unit = "", choices } = findField(...key.split(".")) ?? {};
  if (typeof value === "boolean") return value ? "on" : "off";
  if (typeof value === "string") return choices?.[value] ?? value;
  const numbers = [value].flat().map((number) =>
    (typeof number === "number" ? Number(scaled(number, -power).toPrecision(4)) : number));
  return `${numbers.join(" ")} ${hasUnit ? unit : ""}`.trim();
}

/** Return name and value of a key; with a floor, fields with the same label have the name of their group, and behind the name of a construction its values are changed ones. */
function wordsOf(key, values, hasBase) {
  const [group, name] = key.split(".");
  const label = findField(group, name)?.label;
  const parts = new Set(about.form.filter(({ fields }) => fields.some((field) => field.label === label)).map(({ part }) => part));
  const owner = values.floor && parts.size > 1 ? `${about.form.find((entry) => entry.name === group)?.title.toLowerCase() ?? group} ` : "";
  const changed = hasBase && group === values.floor?.name ? " changed to" : "";
  return `${WORDS[key] ?? `${owner}${label?.toLowerCase() ?? name}`}${changed} ${valueText(values, key)}`;
}

/** Show the table of variants, the first that of the form; `actions` remove and rename one. */
export function showVariants(variants, { remove, rename }) {
  const [first, ...others] = variants;
  const isRoom = variants.every(({ answer }) => answer.room);
  const verdict = ({ answer: { result } }) => element("td", { class: result }, VERDICTS[result]);
  const level = ({ answer }) =>
    element("td", { class: answer.room?.result }, answer.room ? headlineText(answer) : "–");
  const hasLevel = variants.some(({ answer }) => answer.room);
  const hasVerdict = !isRoom || variants.some(({ answer }) => answer.result !== "conforms");
  const texts = [
    ...(hasVerdict ? [[hasLevel ? "Source" : "Verdict", verdict]] : []), ...(hasLevel ? [["Level", level]] : []),
  ];
  const columns = isRoom ? roomColumns(first) : sourceColumns(first);
  const cell = (variant, [, valueOf, unit, decimals]) => {
    const [value, reference] = [valueOf(variant), valueOf(first)];
    if (typeof value !== "number") return "–";
    const text = minus(value.toFixed(decimals));
    if (variant === first || typeof reference !== "number") return text;
    const difference = Number((value - reference).toFixed(decimals));
    return [text, element("small", {}, difference ? signed(difference, "dB", decimals) : "±0")];
  };
  const name = (variant) => element("span", { class: "named" }, swatch(variant.style), button(
    variant.label, () => rename(variant, prompt("Name of the variant", variant.label)),
    { class: "name", title: "Rename", "aria-label": `Rename ${variant.label}` }));
  const removal = (variant) => (others.includes(variant) ? button("×", () => remove(variant),
    { class: "remove", "aria-label": `Remove ${variant.label}` }) : "");
  fillTable("variants", ["Variant", ...texts.map(([title]) => title),
    ...columns.map(([title, , unit]) => [title, element("small", {}, ` ${unit}`)]), element("td")],
  variants.map((variant) => [name(variant), ...texts.map(([, cellOf]) => cellOf(variant)),
    ...columns.map((column) => cell(variant, column)), removal(variant)]));
}

/** Return columns of the table: title, function of a variant, unit and decimals. */
function sourceColumns({ answer: { criteria } }) {
  const bands = criteria.filter(({ band }) => band).map(({ band }, i) =>
    [band, ({ answer }) => answer.criteria[i].value, "dB", 1]);
  const number = (title, name, unit, decimals) =>
    [title, ({ answer }) => answer.numbers.find(([, , , own]) => own === name)?.[1], unit, decimals];
  return [...bands, number("Peak", "peak", "N", 0), number("Contact", "contact_time", "ms", 2)];
}

function roomColumns({ answer: { room: { frequency } } }) {
  return [50, 63, 80, 125, 250, 500].filter((band) => frequency.includes(band)).map((band) =>
    [String(band), ({ answer: { room } }) => room.level[frequency.indexOf(band)], "dB", 1]);
}
