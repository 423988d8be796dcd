// Functions for elements and for the text of numbers.

export const byId = (id) => document.getElementById(id);

/** Return an element with attributes (true: empty value; false or null: omitted) and children. */
export function element(name, attributes = {}, ...children) {
  return setUp(document.createElement(name), attributes, children);
}

/** Return an SVG element, as `element` does. */
export function svgElement(name, attributes = {}, ...children) {
  return setUp(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

/** Set attributes of an element, as `element` does, and append children. */
export function setUp(target, attributes, children = []) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) target.setAttribute(key, "");
    else if ((value ?? false) !== false) target.setAttribute(key, value);
  }
  target.append(...children);
  return target;
}

/** Fill a table with a row of heads and rows; the first cell of each row is its head. */
export function fillTable(id, heads, rows) {
  byId(id).replaceChildren(
    element("thead", {}, element("tr", {}, ...heads.map((cell) => cellOf(cell, "col")))),
    element("tbody", {}, ...rows.map((cells) =>
      element("tr", {}, ...cells.map((cell, i) => cellOf(cell, i ? null : "row"))))));
}

/** Return a cell of a table, the head of a scope if it has one; a list is its children. */
function cellOf(cell, scope) {
  if (cell?.matches?.("td, th")) return cell;
  return element(scope ? "th" : "td", { scope }, ...[cell].flat());
}

/** Return a choice by its options, [value, text] or [title, options] of a group. */
export function select(attributes, options, value) {
  const optionOf = ([name, text]) => (Array.isArray(text)
    ? element("optgroup", { label: name }, ...text.map(optionOf))
    : element("option", { value: name }, text));
  const result = element("select", attributes, ...options.map(optionOf));
  result.value = value;
  return result;
}

/** Return the row of a field: its label, and what follows. */
export function fieldRow(id, label, ...children) {
  return element("div", { class: "field" }, element("label", { for: id }, label), ...children);
}

/** Return a button that calls a function. */
export function button(text, onClick, attributes = {}) {
  const result = element("button", { type: "button", ...attributes }, text);
  result.addEventListener("click", onClick);
  return result;
}

/** Return a number times a power of ten, correctly rounded. */
export function scaled(value, power) {
  const [digits, exponent = "0"] = String(value).split("e");
  return Number(`${digits}e${Number(exponent) + power}`);
}

const NUMBER = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i;
// A comma before three digits may also be one between thousands.
const AMBIGUOUS = /^[+-]?[1-9]\d{0,2},\d{3}$/;

/** Return the number that a text states, with decimals after a point or a comma; otherwise NaN. */
export function numberOf(text) {
  const trimmed = text.trim().replace("−", "-");
  const number = NUMBER.test(trimmed) && !AMBIGUOUS.test(trimmed) ? Number(trimmed.replace(",", ".")) : NaN;
  return Number.isFinite(number) ? number : NaN;
}

/** Return what to enter in place of a text that states no number. */
export function numberProblem(text, unit = "") {
  const typed = text.trim();
  if (AMBIGUOUS.test(typed))
    return `“${typed}” may mean ${numberOf(`${typed}0`)} or ${typed.replace(",", "")}; enter one of them`;
  return `enter a number${unit ? `, in ${unit}` : ""}`;
}

/** Return the text of a number: levels with two decimals, others with three or four digits. */
export function digits(value, unit = "") {
  if (value === null || value === undefined) return "not known";
  const count = Math.abs(value) < 1 ? 3 : 4;
  return minus(unit === "dB" ? value.toFixed(2) : Number(value.toPrecision(count)));
}

/** Return the text of a number with its unit. */
export function rounded(value, unit = "") {
  return typeof value === "number" ? `${digits(value, unit)} ${unit}`.trim() : digits(value);
}

/** Return a number with its sign, which zero has not: levels with `decimals`, others two digits. */
export function signed(value, unit = "", decimals = 2) {
  const size = Math.abs(value);
  const text = unit === "dB" ? size.toFixed(decimals) : String(Number(size.toPrecision(2)));
  if (!Number(text)) return text;
  return `${value < 0 ? "−" : "+"}${text}`;
}

/** Return the text of a number with a typographic minus sign, which a rounded zero has not. */
export function minus(value) {
  return String(value).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
}

export function capitalize(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** Return the nodes of a text in which symbols such as L_FE have subscripts. */
export function withSymbols(text) {
  const symbol = (indices) => element("span", {}, element("i", {}, "L"), element("sub", {}, indices));
  return text.split(/\bL_([A-Za-z]+(?:,[A-Za-z]+)?)/).map((part, i) => (i % 2 ? symbol(part) : part));
}

/** Save a text or a blob as a file. */
export function saveFile(name, content, type = "text/plain") {
  const href = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 1000);
}

/** Return a zone with a title, a button to choose files, and a help; `onFiles` takes those. */
export function fileZone({ id, input: inputId, title, multiple, accept }, help, onFiles) {
  const input = element("input", { type: "file", id: inputId, class: "file", multiple, accept });
  input.addEventListener("change", () => {
    if (input.files.length) onFiles([...input.files]);
    // Otherwise choosing the same file again would raise no event.
    input.value = "";
  });
  const label = element("label", { for: inputId }, `Choose file${multiple ? "s" : ""}`);
  return element("div", { id, class: "drop_zone" }, element("b", {}, title), input, label,
    element("p", { class: "help" }, help));
}
