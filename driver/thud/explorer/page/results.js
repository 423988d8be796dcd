// Display of answers: headline, plots, criteria, floor, room and warnings.
import { byId, capitalize, element, minus, rounded, signed, withSymbols } from "./page.js";
import { plot, swatch } from "./plot.js";

// Uncertainties by their codes: titles, and what stands below the criteria.
const UNCERTAINTIES = { numerical: ["numerical error", "numerical error of the computation"], measured: ["uncertainty (95 %)", "measurement uncertainty (95 %)"] };
// Verdicts on a source, and signs, by the code of the result.
export const SOURCE_VERDICTS = { conforms: "conforms", does_not_conform: "does not conform", undecided: "undecided" };
const SIGNS = { conforms: "✓", does_not_conform: "✕", undecided: "?", level: "" };
// Titles of the force by its code.
const FORCES = { elastic: "Elastic force", floor: "Force on the floor" };
// Uncertainties that are smaller are not drawn, dB.
const MIN_UNCERTAINTY = 0.02;

/** Return the headline of an answer as a text. */
export const headlineText = ({ headline: { words, why, also } }) => `${words}${why}${also}`;

const uncertaintyText = ({ uncertainty, uncertainty_text: text, mark }) => `${text ?? Number(uncertainty.toPrecision(2))}${mark ? ` ${mark}` : ""}`;

/** Show the answer to the question; `variant` has a label and an answer. */
function showHeadline({ label, answer }) {
  // Narrow screens leave further criteria to the table.
  const { result, words, why, also, detail } = answer.headline;
  byId("verdict").className = result;
  byId("verdict").replaceChildren(
    ...(SIGNS[result] ? [element("span", { class: "sign", "aria-hidden": "true" }, SIGNS[result])] : []),
    element("span", { class: "subject" }, `${label} `),
    element("b", {}, capitalize(words)), element("span", { class: "why" }, why, element("span", { class: "wide" }, also)));
  byId("detail").replaceChildren(...withSymbols(detail ?? ""));
  // Narrow screens name the case here.
  if (SIGNS[result]) byId("detail").dataset.subject = label;
  else delete byId("detail").dataset.subject;
  byId("numbers").textContent = answer.numbers.map(([title, value, unit]) => `${title} ${rounded(value, unit)}`).join(" · ");
}

/** Show warnings, and those open that can change the verdict. */
export function showWarnings({ answer: { warnings, open_warnings: open = [] } }) {
  byId("open_warnings").replaceChildren(...open.map((warning) => element("li", {}, ...withSymbols(capitalize(warning)))));
  byId("warnings_section").hidden = !warnings.length;
  byId("warnings_title").textContent = warnings.length === 1 ? "1 warning" : `${warnings.length} warnings`;
  byId("warnings").replaceChildren(...warnings.map((warning) => element("li", {}, ...withSymbols(warning))));
}

/** Return the low and high end of a criterion by its uncertainty. */
function endsOf({ value, uncertainty }) {
  return uncertainty > MIN_UNCERTAINTY ? [value - uncertainty, value + uncertainty] : [];
}

/** Show force and levels of variants, in octaves or one-third octaves. */
function showForces(variants, { thirds }) {
  const [first] = variants;
  const levelsOf = ({ answer }) => (thirds ? answer.levels.thirds : answer.levels);
  const bands = levelsOf(first).frequency;
  const octavesOf = ({ answer }) => answer.criteria.filter((criterion) => criterion.band);
  plot(byId("levels"), {
    title: "Force exposure level",
    curves: variants.map((variant) => ({
      name: variant.label, style: variant.style, x: bands.map((_, k) => k), marks: true,
      y: levelsOf(variant).level, ends: thirds ? undefined : octavesOf(variant).map(endsOf),
    })),
    x: { title: thirds ? "One-third-octave band" : "Octave band", unit: "Hz", bands: bands.map(String) },
    y: { title: "Level", unit: "dB", reference: " re 1 N, 1 s" },
    limits: thirds ? undefined : octavesOf(first).map((criterion) => [criterion.lower, criterion.upper]),
    results: octavesOf(first).map(({ result }) => result),
  });
  byId("force_title").textContent = FORCES[first.answer.force.kind ?? "floor"];
  plot(byId("force"), {
    title: byId("force_title").textContent, hasCursor: true,
    curves: variants.flatMap(({ label, style, answer: { force, floor } }) => [
      { name: label, style, x: force.time, y: force.value },
      ...(floor ? [{ name: `${label}, on the floor`, style, x: floor.force.time, y: floor.force.value, thin: true }] : []),
    ]),
    x: { title: "Time", unit: "ms" },
    y: { title: "Force, low-passed at 1.25 kHz", unit: "N", zero: true },
  });
}

/** Show the levels in the room below, what makes them uncertain, and the ratings. */
function showRooms(variants) {
  const rooms = variants.filter((variant) => variant.answer.room);
  const hasRoom = Boolean(variants[0].answer.room);
  for (const name of ["room_figure", "contributions_figure"]) byId(name).hidden = !hasRoom;
  if (!hasRoom) return;
  const [first] = rooms;
  plot(byId("room"), {
    title: "Level in the room below",
    curves: rooms.map(({ label, style, answer: { room } }) => ({
      name: label, style, x: room.level.map((_, k) => k), marks: true, y: room.level,
      ends: room.level.map((level, k) => [level - room.uncertainty[k], level + room.uncertainty[k]]),
    })),
    x: { title: "One-third-octave band", unit: "Hz", bands: first.answer.room.frequency.map(String) },
    y: { title: "Maximum Fast level", unit: "dB", reference: " re 20 µPa" },
  });
  plot(byId("contributions"), {
    title: "Contributions to the standard uncertainty", x: { title: "Standard uncertainty", unit: "dB" },
    rows: first.answer.room.contributions.filter(([, , value]) => value >= 0.05),
  });
}

/** Return the swatch and the name of a variant; empty if there is only one variant. */
function nameOf(variants, variant) {
  return variants.length > 1 ? [swatch(variant.style), ` ${variant.label}: `] : [];
}

/** Return the distance of a value from the nearer limit, negative outside. */
function marginOf(criterion) {
  return Math.min(criterion.value - criterion.lower, criterion.upper - criterion.value);
}

function missedSide(criterion) {
  if (criterion.value === null) return "not known";
  if (criterion.result === "undecided") return SOURCE_VERDICTS.undecided;
  if (marginOf(criterion) >= 0) return "";
  return criterion.value < criterion.lower ? "low" : "high";
}

/** Show the criteria of the standards; their names explain themselves. */
function showCriteria(variants) {
  const cell = (criterion) => {
    const value = element("td", { class: `value ${criterion.result}` }, minus(criterion.value_text || "not known"));
    if (criterion.uncertainty) value.append(" ", element("span", { title: UNCERTAINTIES[criterion.uncertainty_kind][0] }, `± ${uncertaintyText(criterion)}`));
    return value;
  };
  const margin = (criterion) => {
    const isExact = criterion.lower === criterion.upper || criterion.value === null;
    return element("td", { class: "margin" }, isExact ? "" : signed(marginOf(criterion), criterion.unit), " ", missedSide(criterion));
  };
  const rows = variants[0].answer.criteria.map((criterion, i) => element("tr", {},
    element("th", { scope: "row" }, term(criterion)),
    element("td", {}, criterion.lower === criterion.upper ? `${criterion.lower}` : `${criterion.lower} to ${criterion.upper}`),
    ...variants.flatMap((variant, k) => [cell(variant.answer.criteria[i]), ...(k ? [] : [margin(criterion)])])));
  const heads = variants.flatMap((variant, k) => [
    element("th", { scope: "col" }, ...(variants.length > 1 ? [swatch(variant.style), ` ${variant.label}`] : ["Value"])),
    ...(k ? [] : [element("th", { scope: "col", class: "margin" }, "Margin")]),
  ]);
  byId("criteria").replaceChildren(
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "Criterion"), element("th", { scope: "col" }, "Limits"), ...heads)),
    element("tbody", {}, ...rows));
  byId("criteria_section").classList.toggle("half", Boolean(variants[0].answer.motion) && variants.length < 3);
  const names = new Set(variants.flatMap(({ answer }) => answer.criteria).filter(({ uncertainty }) => uncertainty).map((criterion) => criterion.uncertainty_kind));
  const uncertainties = names.size ? `±: ${[...names].map((kind) => UNCERTAINTIES[kind][1]).join("; ")}. ` : "";
  byId("criteria_text").textContent = `${uncertainties}${variants[0].answer.criteria[0].standard ?? ""}`;
}

/** Return the name of a criterion, which opens its explanation. */
function term(criterion) {
  const name = capitalize(criterion.name) + (criterion.unit ? `, ${criterion.unit}` : "");
  const lines = [["", criterion.explanation], ["Limits: ", criterion.limit_source], ["Standard: ", criterion.standard]];
  return element("details", { class: "term" }, element("summary", {}, name),
    ...lines.filter(([, text]) => text).map(([title, text]) => element("p", {}, element("b", {}, title), ...withSymbols(text))));
}

/** Show how the floors move. */
export function showFloors(variants) {
  const floors = variants.filter((variant) => variant.answer.floor);
  byId("floor_section").hidden = !variants[0].answer.floor;
  if (!variants[0].answer.floor) return;
  byId("floor_title").textContent = `Floor response: ${floors[0].answer.floor.name}`;
  plot(byId("velocity"), {
    title: "Velocity of the floor",
    curves: floors.map(({ label, style, answer: { floor } }) => ({ name: label, style, x: floor.velocity.time, y: floor.velocity.value })),
    x: { title: "Time", unit: "ms" }, y: { title: "Velocity of the floor", unit: "mm/s", zero: true },
  });
  const quantity = ([title, value, unit]) => `${title} ${unit === "dB" ? `${signed(value, unit)} dB` : rounded(value, unit)}`;
  byId("floor_text").replaceChildren(...floors.map((variant) => element("li", {}, ...nameOf(variants, variant), variant.answer.floor.numbers.map(quantity).join("; "))));
  const { header, rows } = floors[0].answer.floor;
  byId("floor_table").replaceChildren(
    element("thead", {}, element("tr", {}, ...header.map((title) => element("th", { scope: "col" }, capitalize(title))))),
    element("tbody", {}, ...rows.map(([first, ...cells]) => element("tr", {}, element("th", { scope: "row" }, first), ...cells.map((text) => element("td", {}, minus(text)))))));
}

/** Show headline, plots and criteria of variants, of which the first is the answer of its door. */
export function showAnswer(variants, options) {
  const [{ door, answer: { room } }] = variants;
  showHeadline(variants[0]);
  for (const name of ["levels_figure", "force_figure"]) byId(name).hidden = Boolean(room);
  byId("force_figure").classList.toggle("second", !room);
  byId("criteria_section").hidden = door === "floor";
  showRooms(variants);
  if (!room) showForces(variants, options);
  if (door !== "floor") showCriteria(variants);
}
