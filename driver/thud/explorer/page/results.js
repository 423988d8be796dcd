// Display of answers: headline, plots, criteria, floor, room and warnings.
import {
  byId, capitalize, digits, element, fillTable, minus, rounded, signed, withSymbols,
} from "thud/page.js";
import { VERDICTS, headlineOf, limitsText, marginOf, resultOf, uncertaintyText } from "thud/headline.js";
import { plot, swatch } from "thud/plot.js";

// Uncertainties by their codes.
const UNCERTAINTIES = {
  numerical: "numerical error of the computation", measured: "measurement uncertainty (95 %)",
};
// Signs by the code of the result.
const SIGNS = { conforms: "✓", does_not_conform: "✕", undecided: "?", level: "" };
// Titles of the force by its code.
const FORCES = { elastic: "Elastic force", floor: "Force on the floor" };
// Heads of the table of the floor.
const OCTAVE_HEADS = ["Octave, Hz", "Rigid floor, dB", "This floor, dB", "Difference, dB", "Energy, mJ"];
// Uncertainties that are smaller are not drawn, dB.
const MIN_UNCERTAINTY = 0.02;

/** Show the answer to the question; `variant` has a label and an answer. */
function showHeadline({ label, answer }) {
  // Narrow screens leave further criteria to the table.
  const { words, why, also, detail } = headlineOf(answer);
  const result = resultOf(answer);
  byId("verdict").className = result;
  byId("verdict").replaceChildren(
    ...(SIGNS[result] ? [element("span", { class: "sign", "aria-hidden": "true" }, SIGNS[result])] : []),
    element("span", { class: "subject" }, `${label} `),
    element("b", {}, capitalize(words)),
    element("span", { class: "why" }, why, element("span", { class: "wide" }, also)));
  byId("detail").replaceChildren(...withSymbols(detail));
  // Narrow screens name the case here.
  if (SIGNS[result]) byId("detail").dataset.subject = label;
  else delete byId("detail").dataset.subject;
  const numbers = answer.numbers.map(([title, value, unit]) => `${title} ${rounded(value, unit)}`);
  byId("numbers").textContent = numbers.join(" · ");
}

/** Show warnings, and those open that can change the verdict. */
export function showWarnings({ answer: { warnings, open_warnings: open = [] } }) {
  const items = (list) => list.map((text) => element("li", {}, ...withSymbols(text)));
  byId("open_warnings").replaceChildren(...items(open.map(capitalize)));
  byId("warnings_section").hidden = !warnings.length;
  byId("warnings_title").textContent = `${warnings.length} warning${warnings.length < 2 ? "" : "s"}`;
  byId("warnings").replaceChildren(...items(warnings));
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
  const octavesOf = ({ answer }) => answer.criteria.filter(({ band }) => band);
  plot(byId("levels"), {
    curves: variants.map((variant) => ({
      name: variant.label, style: variant.style, x: bands.map((_, k) => k), marks: true,
      y: levelsOf(variant).level, ends: thirds ? undefined : octavesOf(variant).map(endsOf),
    })),
    x: { title: `${thirds ? "One-third-o" : "O"}ctave band`, unit: "Hz", bands: bands.map(String) },
    y: { title: "Level", unit: "dB", reference: " re 1 N, 1 s" },
    limits: thirds ? undefined : octavesOf(first).map(({ lower, upper }) => [lower, upper]),
    results: octavesOf(first).map(({ result }) => result),
  });
  byId("force_title").textContent = FORCES[first.answer.force.kind ?? "floor"];
  plot(byId("force"), {
    hasCursor: true,
    curves: variants.flatMap(({ label, style, answer: { force, floor } }) => [
      { name: label, style, x: force.time, y: force.value },
      floor && { name: `${label}, on the floor`, style, x: floor.force.time, y: floor.force.value, thin: true },
    ]).filter(Boolean),
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
  const { frequency: bands, contributions } = rooms[0].answer.room;
  plot(byId("room"), {
    curves: rooms.map(({ label, style, answer: { room } }) => ({
      name: label, style, x: room.level.map((_, k) => k), marks: true, y: room.level,
      ends: room.level.map((level, k) => [level - room.uncertainty[k], level + room.uncertainty[k]]),
    })),
    x: { title: "One-third-octave band", unit: "Hz", bands: bands.map(String) },
    y: { title: "Maximum Fast level", unit: "dB", reference: " re 20 µPa" },
  });
  fillTable("contributions", ["Contribution", "Standard uncertainty, dB"], contributions
    .filter(([, value]) => value >= 0.05).map(([title, value]) => [title, value.toFixed(1)]));
}

/** Return the swatch and the name of a variant; a text if there is only one variant. */
export function nameOf(variants, { style, label }, text) {
  return variants.length > 1 ? [swatch(style), ` ${label}`] : [text];
}

function missedSide(criterion) {
  if (criterion.value === null) return "not known";
  if (criterion.result === "undecided") return VERDICTS.undecided;
  if (marginOf(criterion) >= 0) return "";
  return criterion.value < criterion.lower ? "low" : "high";
}

/** Show the criteria of the standards; their names explain themselves. */
function showCriteria(variants) {
  const valueOf = (criterion) => {
    const { result, uncertainty, value_text: text } = criterion;
    const expanded = uncertainty ? [" ", element("span", {}, uncertaintyText(criterion))] : [];
    return element("td", { class: `value ${result}` }, minus(text || "not known"), ...expanded);
  };
  const marginCell = (criterion) => {
    const isExact = criterion.lower === criterion.upper || criterion.value === null;
    const text = isExact ? "" : signed(marginOf(criterion), criterion.unit);
    return element("td", { class: "margin" }, `${text} ${missedSide(criterion)}`);
  };
  const [{ answer: { criteria, limits, motion } }, ...others] = variants;
  const head = (variant) => nameOf(variants, variant, "Value");
  fillTable("criteria", ["Criterion", "Limits", head(variants[0]),
    element("th", { scope: "col", class: "margin" }, "Margin"), ...others.map(head)],
  criteria.map((criterion, i) => [
    term(criterion, limits), limitsText(criterion), valueOf(criterion),
    marginCell(criterion), ...others.map(({ answer }) => valueOf(answer.criteria[i]))]));
  byId("criteria_section").classList.toggle("half", Boolean(motion) && variants.length < 3);
  const stated = variants.flatMap(({ answer }) => answer.criteria.filter((entry) => entry.uncertainty));
  const kinds = [...new Set(stated.map((entry) => UNCERTAINTIES[entry.uncertainty_kind]))];
  const text = kinds.length ? `±: ${kinds.join("; ")}. ` : "";
  byId("criteria_text").textContent = `${text}${limits.standard}`;
}

/** Return the name of a criterion, which opens its explanation. */
function term(criterion, { standard }) {
  const name = capitalize(criterion.name) + (criterion.unit ? `, ${criterion.unit}` : "");
  const { explanation, limit_source: limits } = criterion;
  const lines = [["", explanation], ["Limits: ", limits], ["Standard: ", standard]];
  return element("details", { class: "term" }, element("summary", {}, name),
    ...lines.map(([title, text]) => element("p", {}, element("b", {}, title), ...withSymbols(text))));
}

/** Show how the floors move. */
export function showFloors(variants) {
  const floors = variants.filter((variant) => variant.answer.floor);
  byId("floor_section").hidden = !variants[0].answer.floor;
  if (!variants[0].answer.floor) return;
  const { name, octaves } = floors[0].answer.floor;
  byId("floor_title").textContent = `Floor response: ${name}`;
  plot(byId("velocity"), {
    curves: floors.map(({ label, style, answer: { floor: { velocity } } }) =>
      ({ name: label, style, x: velocity.time, y: velocity.value })),
    x: { title: "Time", unit: "ms" }, y: { title: "Velocity of the floor", unit: "mm/s", zero: true },
  });
  const quantity = ([title, value, unit]) => `${title} ${rounded(value, unit)}`;
  byId("floor_text").replaceChildren(...floors.map((variant) => element("li", {},
    ...nameOf(variants, variant, ""), ` ${variant.answer.floor.numbers.map(quantity).join("; ")}`)));
  fillTable("floor_table", OCTAVE_HEADS, octaves.map(([band, ...levels]) =>
    [String(band), ...levels.map((value, i) => digits(value, i < 3 ? "dB" : "mJ"))]));
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
