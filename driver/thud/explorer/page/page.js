// Small helpers: elements, numbers.

export const byId = (id) => document.getElementById(id);

/** Return an element with attributes (true: empty, false or null: left out) and children. */
export function element(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** Return an element of a drawing. */
export function drawn(name, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function fill(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(key, "");
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** Return a number times a power of ten, correctly rounded. */
export function scaled(value, power) {
  const [digits, exponent = "0"] = String(value).split("e");
  return Number(`${digits}e${Number(exponent) + power}`);
}

/** Return a number with its unit: levels with two decimals, others with four digits. */
export function rounded(value, unit = "") {
  if (value === null || value === undefined) return "not known";
  return `${minus(unit === "dB" ? value.toFixed(2) : Number(value.toPrecision(4)))} ${unit}`.trim();
}

/** Return a number with a sign: levels with two decimals, others with two digits. */
export function signed(value, unit = "") {
  const size = Math.abs(value);
  return `${value < 0 ? "−" : "+"}${unit === "dB" ? size.toFixed(2) : Number(size.toPrecision(2))}`;
}

/** Return a number as text, with the minus of the field. */
export function minus(value) {
  return String(value).replace("-", "−");
}

export function capitalize(words) {
  return words.charAt(0).toUpperCase() + words.slice(1);
}
