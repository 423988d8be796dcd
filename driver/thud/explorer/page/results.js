// What is shown of the answers: verdict, plots, criteria, floor, room, warnings.
import { begun, byId, element, minus, rounded, signed } from "./page.js";
import { showBall } from "./ball.js";
import { plot, swatch } from "./plot.js";

/** Show variants, the first of them that of the form; `remove` takes one away. */
export function show(variants, remove) {
  if (!variants.length) return;
  const [first] = variants;
  summarise(first);
  const curve = (one, style, x, y, more = {}) => ({ name: one.name, style, x, y, ...more });
  const forces = variants.flatMap((one, i) => {
    const { force, floor } = one.answer;
    const moved = floor ? [curve({ name: `${one.name}, ${floor.name}` }, i, floor.force.time, floor.force.value, { thin: true })] : [];
    return [curve(one, i, force.time, force.value), ...moved];
  });
  const thin = first.answer.floor ? element("small", {}, ` thin: on the ${first.answer.floor.name}`) : "";
  byId("force_title").replaceChildren(begun(first.answer.force.words ?? "force"), thin);
  plot(byId("force"), { curves: forces, x: { title: "Time", unit: "ms" }, y: { title: "Force, low-passed at 1.25 kHz", unit: "N", zero: true } });
  const names = (levels) => levels.frequency.map(String);
  const bands = (one, i, levels) => curve(one, i, levels.frequency.map((_, k) => k), levels.level, { marks: true });
  plot(byId("levels"), {
    curves: variants.map((one, i) => bands(one, i, one.answer.levels)),
    x: { title: "Octave band", unit: "Hz", bands: names(first.answer.levels) },
    y: { title: "Level", unit: "dB", reference: " re 1 N" },
    limits: first.answer.criteria.filter((one) => one.band).map((one) => [one.lower, one.upper]),
  });
  showFloors(variants, curve);
  const rooms = variants.filter((one) => one.answer.room);
  byId("room_section").hidden = !rooms.length;
  if (rooms.length) {
    plot(byId("room"), {
      curves: rooms.map((one) => bands(one, variants.indexOf(one), one.answer.room)),
      x: { title: "One-third-octave band", unit: "Hz", bands: names(rooms[0].answer.room) },
      y: { title: "Maximum Fast level", unit: "dB", reference: " re 20 µPa" },
    });
    byId("room_words").replaceChildren(...rooms.map((one) => element("li", {}, key(variants, one), "L", element("sub", {}, "iA,Fmax"),
      ` ${one.answer.room.rating} dB, standardized ${one.answer.room.standardized} dB`)));
  }
  showCriteria(variants);
  showVariants(variants, remove);
  showBall(first.answer.motion);
  const warnings = variants.flatMap((one) => one.answer.warnings.map((warning) => [one, warning]));
  byId("warnings_section").hidden = !warnings.length;
  byId("warnings").replaceChildren(...warnings.map(([one, warning]) => element("li", {}, key(variants, one), warning)));
}

/** Return the swatch and name of a variant where there are several. */
function key(variants, one) {
  return variants.length > 1 ? element("span", {}, swatch(variants.indexOf(one)), ` ${one.name}: `) : "";
}

/** Return how far a value is from its limits: the nearer one, negative outside. */
function margin(one) {
  return Math.min(one.value - one.lower, one.upper - one.value);
}

function away(one) {
  if (one.value === null) return "not known";
  if (margin(one) >= 0) return one.verdict === "conforms" ? "" : "undecided";
  return one.value < one.lower ? "low" : "high";
}

function summarise({ name, answer }) {
  const missed = answer.criteria.filter((one) => one.verdict !== "conforms");
  const words = missed.map((one) => {
    const by = one.value !== null && margin(one) < 0 ? `${Number((-margin(one)).toPrecision(2))} ${one.unit} `.replace("  ", " ") : "";
    return `${one.name} ${by}${away(one)}`;
  });
  byId("verdict").textContent = `${name} ${answer.verdict}${words.length ? `: ${words.join(", ")}` : ""}`;
  byId("verdict").className = answer.conforms ? "conforms" : "fails";
  const numbers = answer.numbers.map(([what, value, unit]) => `${what} ${rounded(value, unit)}`);
  const time = `computed in ${Number((1e3 * answer.seconds).toPrecision(2))} ms`;
  byId("numbers").replaceChildren(numbers.join(" · "), element("span", { class: "extra" }, ` · ${time}`));
}

function showCriteria(variants) {
  const cell = (one) => {
    const found = element("td", { class: one.verdict === "conforms" ? "conforms" : "fails" }, rounded(one.value, one.unit).replace(one.unit && ` ${one.unit}`, ""));
    if (one.uncertainty) found.append(` ± ${Number(one.uncertainty.toPrecision(2))}`);
    const exact = one.lower === one.upper || one.value === null;
    return [found, element("td", { class: "margin" }, exact ? "" : signed(margin(one), one.unit), " ", away(one))];
  };
  const rows = variants[0].answer.criteria.map((one, i) => element("tr", {},
    element("th", { scope: "row" }, begun(one.name) + (one.unit ? `, ${one.unit}` : "")),
    element("td", {}, one.lower === one.upper ? `${one.lower}` : `${one.lower} to ${one.upper}`),
    ...variants.flatMap((other) => cell(other.answer.criteria[i]))));
  const heads = variants.flatMap((one, i) => [
    element("th", { scope: "col" }, ...(variants.length > 1 ? [swatch(i), ` ${one.short}`] : ["Value"])),
    element("th", { scope: "col", class: "margin" }, "Margin"),
  ]);
  byId("cards").classList.toggle("many", variants.length > 1);
  byId("criteria").replaceChildren(
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "Criterion"), element("th", { scope: "col" }, "Limits"), ...heads)),
    element("tbody", {}, ...rows));
}

function showVariants(variants, remove) {
  byId("variants_section").hidden = variants.length < 2;
  byId("variants").replaceChildren(...variants.map((one, i) => {
    const line = element("li", {}, swatch(i), element("b", {}, ` ${one.short}`), one.words ? ` ${one.words} ` : " ");
    if (one.pinned) {
      const button = element("button", { type: "button", "aria-label": `Remove ${one.short}` }, "×");
      button.addEventListener("click", () => { remove(one); byId("pin").focus(); });
      line.append(button);
    }
    return line;
  }));
}

function showFloors(variants, curve) {
  const floors = variants.filter((one) => one.answer.floor);
  byId("floor_section").hidden = !floors.length;
  if (!floors.length) return;
  byId("floor_title").textContent = `Floor response: ${floors[0].answer.floor.name}`;
  plot(byId("velocity"), {
    curves: floors.map((one) => curve(one, variants.indexOf(one), one.answer.floor.velocity.time, one.answer.floor.velocity.value)),
    x: { title: "Time", unit: "ms" }, y: { title: "Velocity of the floor", unit: "mm/s", zero: true },
  });
  byId("floor_words").replaceChildren(...floors.map((one) => element("li", {}, key(variants, one),
    one.answer.floor.numbers.map(([what, value, unit]) => `${what} ${unit === "dB" ? `${signed(value, unit)} dB` : rounded(value, unit)}`).join("; "))));
  const { head, rows } = floors[0].answer.floor;
  byId("floor_table").replaceChildren(
    element("thead", {}, element("tr", {}, ...head.map((one) => element("th", { scope: "col" }, begun(one))))),
    element("tbody", {}, ...rows.map(([first, ...cells]) => element("tr", {}, element("th", { scope: "row" }, first), ...cells.map((one) => element("td", {}, minus(one)))))));
}
