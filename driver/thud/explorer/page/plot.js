// Plots of curves against numbers or bands, with limits.
import { element, minus, rounded, setUp, svgElement } from "thud/page.js";

const MARKS = [
  (x, y) => svgElement("circle", { cx: x, cy: y, r: 4 }),
  (x, y) => svgElement("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7 }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l5 5l-5 5l-5-5z` }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l4.5 8h-9z` }),
];
/** Number of styles of curves. */
export const STYLES = 6;
// Width of a letter, px.
const LETTER = 6.8;
const drawn = new Map();
const watcher = new ResizeObserver((entries) => entries.forEach((entry) => redraw(entry.target)));

/** Draw a plot in an element.
 *
 * `content` has `curves` with name, style, x, y and the options `marks`, `thin` and
 * `ends` ([low, high] of each value). The axes `x` and `y` have a title and a unit; `x.bands` is a
 * list of names of bands. `limits` are [lower, upper] of each band, and `results` are those of the
 * first curve. With `hasCursor` the first curve has the cursor of `setCursor`.
 */
export function plot(host, content) {
  const entry = drawn.get(host) ?? {};
  if (!drawn.has(host)) watcher.observe(host);
  drawn.set(host, Object.assign(entry, { content }));
  redraw(host);
}

/** Return the content of a plot. */
export function contentOf(host) {
  return drawn.get(host)?.content;
}

/** Show a line at a position of the x axis with a mark on the first curve; null hides it. */
export function setCursor(host, at) {
  const entry = drawn.get(host);
  if (!entry) return;
  entry.at = at;
  const { content, drawing } = entry;
  if (!drawing || !content.hasCursor) return;
  const [{ x, y }] = content.curves;
  const isInside = at !== null && at >= x[0] && at <= x.at(-1);
  setUp(drawing.moment, { visibility: isInside ? "visible" : "hidden" });
  if (!isInside) return;
  const [line, dot] = drawing.moment.children;
  setUp(line, { x1: drawing.toX(at), x2: drawing.toX(at) });
  setUp(dot, { cx: drawing.toX(at), cy: drawing.toY(y[nearest(x, at)]) });
}

/** Return the index of the value that is nearest to another. */
function nearest(values, at) {
  const distance = (i) => Math.abs(values[i] - at);
  return values.reduce((best, _, i) => (distance(i) < distance(best) ? i : best), 0);
}

/** Return a short line in the style of a curve, for legends, with its mark if it has marks. */
export function swatch(style, hasMarks = false) {
  const line = svgElement("g", { class: `curve style${style % STYLES}` }, svgElement("path", { d: "M0 6h26" }));
  if (hasMarks) line.append(MARKS[style % MARKS.length](13, 6));
  return svgElement("svg", { width: 26, height: 12, "aria-hidden": "true", class: "swatch" }, line);
}

function redraw(host) {
  const entry = drawn.get(host);
  const [width, height] = [host.clientWidth, host.clientHeight];
  if (!entry?.content || !width || !height) return;
  entry.drawing = drawCurves(entry.content, width, height);
  const { image } = entry.drawing;
  const readout = element("div", { class: "readout", hidden: true });
  showValuesAtPointer(entry, image, readout);
  host.replaceChildren(image, readout);
  if (entry.at !== undefined) setCursor(host, entry.at);
}

/** Return a text that begins, has its middle or ends at a position. */
const text = (x, y, content, anchor = "start", attributes = {}) =>
  svgElement("text", { x, y, "text-anchor": anchor, ...attributes }, content);
const quiet = (...values) => setUp(text(...values), { class: "quiet" });
const line = (name, x1, x2, y1, y2) => svgElement("line", { class: name, x1, x2, y1, y2 });
const titleOf = ({ title, unit, reference = "" }) => `${title}, ${unit}${reference}`;

function drawCurves(content, width, height) {
  const { curves, limits = [], results = [], x: { bands } } = content;
  const across = bands ? [-0.5, bands.length - 0.5] : rangeOf(curves.map(({ x }) => x));
  const values = curves.flatMap(({ y, ends = [] }) => [y, ...ends]);
  const up = padded(rangeOf([...values, limits.flat(), content.y.zero ? [0] : []]));
  const marksUp = ticks(up, height / 40);
  const left = 10 + LETTER * Math.max(...marksUp.map((mark) => minus(mark).length));
  const box = { left, right: width - 10, top: 24, bottom: height - 36 };
  const toX = (value) => left + ((value - across[0]) / (across[1] - across[0])) * (box.right - left);
  const toY = (value) => box.bottom - ((value - up[0]) / (up[1] - up[0])) * (box.bottom - box.top);
  const viewBox = `0 0 ${width} ${height}`;
  const description = describeCurves(content);
  const image = svgElement("svg", { width, height, viewBox, role: "img", "aria-label": description });
  image.append(...limits.map(([lower, upper], i) => svgElement("rect", {
    class: `limits ${results[i] ?? ""}`, x: toX(i - 0.38), width: toX(0.76) - toX(0), y: toY(upper),
    height: toY(lower) - toY(upper),
  })));
  for (const value of marksUp) {
    const y = toY(value);
    image.append(line(value === 0 ? "axis" : "grid", left, box.right, y, y));
    image.append(quiet(left - 5, y + 4, minus(value), "end"));
  }
  const marksAcross = bands?.map((_, i) => i) ?? ticks(across, (box.right - left) / 60);
  // If the names of bands do not fit, only every second, third … name is shown.
  const longest = LETTER * Math.max(0, ...(bands ?? []).map((name) => name.length)) + 6;
  const every = bands ? Math.ceil((longest * bands.length) / (box.right - left)) : 1;
  for (const [i, value] of marksAcross.entries()) {
    const x = toX(value);
    if (!bands) image.append(line("grid", x, x, box.top, box.bottom));
    if (i % every === 0) image.append(quiet(x, box.bottom + 16, bands?.[i] ?? minus(value), "middle"));
  }
  image.append(quiet(box.right, height - 5, titleOf(content.x), "end"), quiet(2, 13, titleOf(content.y)));
  // The first curve is drawn over the others.
  image.append(...curves.map((curve) => curveElement(curve, toX, toY)).reverse());
  const moment = svgElement("g", { class: "moment", visibility: "hidden" },
    svgElement("line", { y1: box.top, y2: box.bottom }), svgElement("circle", { r: 4.5 }));
  image.append(moment);
  return { image, across, box, toX, toY, moment };
}

function curveElement(curve, toX, toY) {
  const points = curve.x.map((x, i) => [toX(x), curve.y[i]]).filter(([, y]) => y !== null)
    .map(([x, y]) => [x, toY(y)]);
  const way = points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L");
  const style = `curve style${curve.style % STYLES}${curve.thin ? " thin" : ""}`;
  const group = svgElement("g", { class: style }, svgElement("path", { d: `M${way}` }));
  for (const [i, [low, high]] of (curve.ends ?? []).entries()) {
    if (low === undefined) continue;
    const [x, bottom, top] = [toX(curve.x[i]), toY(low), toY(high)];
    const d = `M${x} ${bottom}V${top}m-4 0h8M${x - 4} ${bottom}h8`;
    group.append(svgElement("path", { class: "bar", d }));
  }
  if (curve.marks) group.append(...points.map(([x, y]) => MARKS[curve.style % MARKS.length](x, y)));
  return group;
}

/** Show the values of all curves at the pointer. */
function showValuesAtPointer({ content, drawing }, image, readout) {
  const { across, box, toX } = drawing;
  const cursor = svgElement("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  image.append(cursor);
  image.addEventListener("pointermove", ({ offsetX }) => {
    const { left, right } = box;
    const at = across[0] + ((offsetX - left) / (right - left)) * (across[1] - across[0]);
    const isInside = offsetX >= left && offsetX <= right;
    if (isInside) showValues(content, at, readout);
    const x = content.x.bands ? toX(Math.round(at)) : offsetX;
    setUp(cursor, { x1: x, x2: x, visibility: isInside ? "visible" : "hidden" });
    readout.hidden = !isInside;
    // On the side of the plot away from the cursor.
    readout.classList.toggle("left", offsetX > (left + right) / 2);
  });
  image.addEventListener("pointerleave", () => {
    readout.hidden = true;
    setUp(cursor, { visibility: "hidden" });
  });
}

function showValues({ curves, x: { bands, unit }, y }, at, readout) {
  const band = bands && Math.min(bands.length - 1, Math.max(0, Math.round(at)));
  const lines = curves.map((curve) => element("div", {}, swatch(curve.style, curve.marks),
    ` ${rounded(curve.y[nearest(curve.x, at)], y.unit)}`));
  readout.replaceChildren(`${bands ? bands[band] : rounded(at)} ${unit}`, ...lines);
}

/** Return a description of a plot for screen readers. */
function describeCurves({ curves, x: { bands, unit }, y: axis }) {
  const lines = curves.map(({ name, y }) => `${name}: ${bands
    ? y.map((value, i) => `${bands[i]} ${unit} ${rounded(value)}`).join(", ")
    : `maximum ${rounded(Math.max(...y))}`}`);
  return `${axis.title}, ${axis.unit}. ${lines.join("; ")}`;
}

function rangeOf(lists) {
  const values = lists.flat().filter((value) => value !== null && Number.isFinite(value));
  return values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
}

function padded([low, high]) {
  const pad = 0.05 * (high - low || Math.abs(high) || 1);
  return [low - pad, high + pad];
}

/** Return round values within a range, about `count` of them. */
function ticks([low, high], count) {
  const rough = (high - low) / Math.max(2, Math.floor(count));
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * (1 - 1e-9));
  const values = [];
  const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
  for (let i = first; i <= last; i += 1) values.push(Number((i * step).toPrecision(12)));
  return values;
}
