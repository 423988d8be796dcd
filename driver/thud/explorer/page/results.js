// Display of answers: verdict, plots, criteria, floor, room and warnings.
import { byId, capitalize, element, minus, rounded, signed } from "./page.js";
import { showBall } from "./ball.js";
import { plot, swatch } from "./plot.js";

/** Show variants, of which the first belongs to the form; `remove` removes a variant. */
export function show(variants, remove) {
  if (!variants.length) return;
  const [first] = variants;
  summarize(first);
  const curve = (variant, style, x, y, options = {}) => ({ name: variant.name, style, x, y, ...options });
  const forces = variants.flatMap((variant, i) => {
    const { force, floor } = variant.answer;
    const onFloor = floor ? [curve({ name: `${variant.name}, ${floor.name}` }, i, floor.force.time, floor.force.value, { thin: true })] : [];
    return [curve(variant, i, force.time, force.value), ...onFloor];
  });
  const legend = first.answer.floor ? element("small", {}, ` thin: on the ${first.answer.floor.name}`) : "";
  byId("force_title").replaceChildren(capitalize(first.answer.force.title ?? "force"), legend);
  plot(byId("force"), { curves: forces, x: { title: "Time", unit: "ms" }, y: { title: "Force, low-passed at 1.25 kHz", unit: "N", zero: true } });
  const names = (levels) => levels.frequency.map(String);
  const bands = (variant, i, levels) => curve(variant, i, levels.frequency.map((_, k) => k), levels.level, { marks: true });
  plot(byId("levels"), {
    curves: variants.map((variant, i) => bands(variant, i, variant.answer.levels)),
    x: { title: "Octave band", unit: "Hz", bands: names(first.answer.levels) },
    y: { title: "Level", unit: "dB", reference: " re 1 N" },
    limits: first.answer.criteria.filter((criterion) => criterion.band).map((criterion) => [criterion.lower, criterion.upper]),
  });
  showFloors(variants, curve);
  const rooms = variants.filter((variant) => variant.answer.room);
  byId("room_section").hidden = !rooms.length;
  if (rooms.length) {
    plot(byId("room"), {
      curves: rooms.flatMap((variant) => {
        const [i, { room }] = [variants.indexOf(variant), variant.answer];
        const modal = curve({ name: `${variant.name}, by modes` }, i, room.modal_level.map((_, k) => k), room.modal_level, { thin: true });
        return [bands(variant, i, room), ...(room.modal_level.length ? [modal] : [])];
      }),
      x: { title: "One-third-octave band", unit: "Hz", bands: names(rooms[0].answer.room) },
      y: { title: "Maximum Fast level", unit: "dB", reference: " re 20 µPa" },
    });
    byId("room_text").replaceChildren(...rooms.map((variant) => element("li", {}, label(variants, variant), variant.answer.room.ratings)));
  }
  showCriteria(variants);
  showVariants(variants, remove);
  showBall(first.answer.motion);
  const warnings = variants.flatMap((variant) => variant.answer.warnings.map((warning) => [variant, warning]));
  byId("warnings_section").hidden = !warnings.length;
  byId("warnings").replaceChildren(...warnings.map(([variant, warning]) => element("li", {}, label(variants, variant), warning)));
}

/** Return the swatch and the name of a variant; empty if there is only one variant. */
function label(variants, variant) {
  return variants.length > 1 ? element("span", {}, swatch(variants.indexOf(variant)), ` ${variant.name}: `) : "";
}

/** Return the distance of a value from the nearer limit, negative outside. */
function margin(criterion) {
  return Math.min(criterion.value - criterion.lower, criterion.upper - criterion.value);
}

function missedSide(criterion) {
  if (criterion.value === null) return "not known";
  if (criterion.verdict === "inconclusive") return "undecided";
  if (margin(criterion) >= 0) return "";
  return criterion.value < criterion.lower ? "low" : "high";
}

function summarize({ name, answer }) {
  const failed = answer.criteria.filter((criterion) => criterion.verdict !== "conforms");
  const model = answer.model_verdict;
  const reasons = failed.map((criterion) => {
    const by = criterion.value !== null && margin(criterion) < 0 ? `${Number((-margin(criterion)).toPrecision(2))} ${criterion.unit} `.replace("  ", " ") : "";
    return `${criterion.name} ${by}${missedSide(criterion)}`;
  });
  byId("verdict").textContent = model ? `${name}: ${model.reason}` : `${name} ${answer.verdict}${reasons.length ? `: ${reasons.join(", ")}` : ""}`;
  byId("verdict").className = (model ? model.result === "conforms" : answer.conforms) ? "conforms" : "fails";
  const numbers = answer.numbers.map(([title, value, unit]) => `${title} ${rounded(value, unit)}`);
  const time = `computed in ${Number((1e3 * answer.seconds).toPrecision(2))} ms`;
  byId("numbers").replaceChildren(numbers.join(" · "), element("span", { class: "extra" }, ` · ${time}`));
}

function showCriteria(variants) {
  const cell = (criterion) => {
    const text = criterion.value_text ?? rounded(criterion.value, criterion.unit).replace(criterion.unit && ` ${criterion.unit}`, "");
    const value = element("td", { class: `value ${criterion.verdict === "conforms" ? "conforms" : "fails"}` }, text);
    if (criterion.uncertainty) {
      const uncertainty = criterion.uncertainty_text ?? Number(criterion.uncertainty.toPrecision(2));
      value.append(" ", element("span", { title: criterion.uncertainty_name }, `± ${uncertainty}`));
    }
    if (criterion.range) value.append(element("small", {}, ` (${criterion.range})`));
    const exact = criterion.lower === criterion.upper || criterion.value === null;
    return [value, element("td", { class: "margin" }, exact ? "" : signed(margin(criterion), criterion.unit), " ", missedSide(criterion))];
  };
  const rows = variants[0].answer.criteria.map((criterion, i) => element("tr", {},
    element("th", { scope: "row" }, capitalize(criterion.name) + (criterion.unit ? `, ${criterion.unit}` : "")),
    element("td", {}, criterion.lower === criterion.upper ? `${criterion.lower}` : `${criterion.lower} to ${criterion.upper}`),
    ...variants.flatMap((variant) => cell(variant.answer.criteria[i]))));
  const heads = variants.flatMap((variant, i) => [
    element("th", { scope: "col" }, ...(variants.length > 1 ? [swatch(i), ` ${variant.short}`] : ["Value"]), variant.answer.model_verdict ? element("small", {}, " (range 95 %)") : ""),
    element("th", { scope: "col", class: "margin" }, "Margin"),
  ]);
  byId("cards").classList.toggle("many", variants.length > 1);
  byId("criteria").replaceChildren(
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "Criterion"), element("th", { scope: "col" }, "Limits"), ...heads)),
    element("tbody", {}, ...rows));
}

function showVariants(variants, remove) {
  byId("variants_section").hidden = variants.length < 2;
  byId("variants").replaceChildren(...variants.map((variant, i) => {
    const line = element("li", {}, swatch(i), element("b", {}, ` ${variant.short}`), variant.description ? ` ${variant.description} ` : " ");
    if (variant.pinned) {
      const button = element("button", { type: "button", "aria-label": `Remove ${variant.short}` }, "×");
      button.addEventListener("click", () => { remove(variant); byId("pin").focus(); });
      line.append(button);
    }
    return line;
  }));
}

function showFloors(variants, curve) {
  const floors = variants.filter((variant) => variant.answer.floor);
  byId("floor_section").hidden = !floors.length;
  if (!floors.length) return;
  byId("floor_title").textContent = `Floor response: ${floors[0].answer.floor.name}`;
  plot(byId("velocity"), {
    curves: floors.map((variant) => curve(variant, variants.indexOf(variant), variant.answer.floor.velocity.time, variant.answer.floor.velocity.value)),
    x: { title: "Time", unit: "ms" }, y: { title: "Velocity of the floor", unit: "mm/s", zero: true },
  });
  byId("floor_text").replaceChildren(...floors.map((variant) => element("li", {}, label(variants, variant),
    variant.answer.floor.numbers.map(([title, value, unit]) => `${title} ${unit === "dB" ? `${signed(value, unit)} dB` : rounded(value, unit)}`).join("; "))));
  const { header, rows } = floors[0].answer.floor;
  byId("floor_table").replaceChildren(
    element("thead", {}, element("tr", {}, ...header.map((title) => element("th", { scope: "col" }, capitalize(title))))),
    element("tbody", {}, ...rows.map(([first, ...cells]) => element("tr", {}, element("th", { scope: "row" }, first), ...cells.map((cell) => element("td", {}, minus(cell)))))));
}
