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

function setUp(target, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) target.setAttribute(key, "");
    else if (value !== null && value !== undefined && value !== false) target.setAttribute(key, value);
  }
  target.append(...children);
  return target;
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

/** Return the number that a text states, with a point or a comma before its decimals; NaN if it states none. */
export function numberOf(text) {
  const trimmed = text.trim().replace("−", "-");
  const number = NUMBER.test(trimmed) && !AMBIGUOUS.test(trimmed) ? Number(trimmed.replace(",", ".")) : NaN;
  return Number.isFinite(number) ? number : NaN;
}

/** Return what to enter in place of a text that states no number. */
export function numberProblem(text, unit = "") {
  const typed = text.trim();
  if (AMBIGUOUS.test(typed)) return `“${typed}” may mean ${numberOf(`${typed}0`)} or ${typed.replace(",", "")}; enter one of them`;
  return `enter a number${unit ? `, in ${unit}` : ""}`;
}

/** Return the text of a number in a unit, without it: levels with two decimals, others with four digits, below 1 with three. */
export function digits(value, unit = "") {
  if (value === null || value === undefined) return "not known";
  return minus(unit === "dB" ? value.toFixed(2) : Number(value.toPrecision(Math.abs(value) < 1 ? 3 : 4)));
}

/** Return the text of a number with its unit. */
export function rounded(value, unit = "") {
  return value === null || value === undefined ? digits(value) : `${digits(value, unit)} ${unit}`.trim();
}

/** Return the text of a number with its sign: levels with `decimals` decimals, others with two digits. */
export function signed(value, unit = "", decimals = 2) {
  const size = Math.abs(value);
  const text = unit === "dB" ? size.toFixed(decimals) : String(Number(size.toPrecision(2)));
  if (!Number(text)) return `±${text}`;
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
  return text.split(/(\bL_[A-Za-z]+(?:,[A-Za-z]+)?)/).map((part) =>
    (/^L_/.test(part) ? element("span", { class: "symbol" }, element("i", {}, "L"), element("sub", {}, part.slice(2))) : part));
}

/** Save a text or a blob as a file. */
export function saveFile(name, content, type = "text/plain") {
  const link = element("a", { href: URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Return a zone with a title, a button to choose files, and a help; `onFiles` is called with those that were chosen. */
export function fileZone({ id, input: inputId, title, label, multiple, accept }, help, onFiles) {
  const input = element("input", { type: "file", id: inputId, class: "file", multiple, accept });
  input.addEventListener("change", () => {
    if (input.files.length) onFiles([...input.files]);
    // Otherwise choosing the same file again would raise no event.
    input.value = "";
  });
  return element("div", { id, class: "drop_zone" }, element("b", {}, title), input, element("label", { for: inputId }, label), help);
}
