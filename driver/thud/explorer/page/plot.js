// Plots of curves against numbers or bands, with limits, and bars of ranges; drawn at the size of their element.
import { svgElement, element, minus, rounded } from "./page.js";

const MARKS = [
  (x, y) => svgElement("circle", { cx: x, cy: y, r: 4 }),
  (x, y) => svgElement("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7 }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l5 5l-5 5l-5-5z` }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l4.5 8h-9z` }),
];
/** Number of styles of curves. */
export const STYLES = 6;
// Width of a letter and height of a line, px.
const LETTER = 6.8;
const LINE = 17;
const drawn = new Map();
const watcher = new ResizeObserver((entries) => entries.forEach((entry) => redraw(entry.target)));

/** Draw a plot in an element.
 *
 * `content` has a title and either `rows` of bars, [title, low, high], or `curves`. These have name,
 * style, x, y and the options `marks`, `thin` and `ends` ([low, high] of each value). The axes `x`
 * and `y` have a title and a unit; `x.bands` is a list of names of bands. `limits` are [lower, upper]
 * of each band, and `results` are those of the first curve. With `hasCursor` the first
 * curve has the cursor of `setCursor`.
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

/** Show a vertical line at a position of the x axis with a mark on the first curve; null hides it. */
export function setCursor(host, at) {
  const entry = drawn.get(host);
  if (!entry) return;
  entry.at = at;
  const { content, drawing } = entry;
  if (!drawing?.moment || !content.hasCursor) return;
  const curve = content.curves[0];
  const isInside = at !== null && curve && at >= drawing.across[0] && at <= drawing.across[1];
  drawing.moment.setAttribute("visibility", isInside ? "visible" : "hidden");
  if (!isInside) return;
  const [line, dot] = drawing.moment.children;
  line.setAttribute("x1", drawing.toX(at));
  line.setAttribute("x2", drawing.toX(at));
  dot.setAttribute("cx", drawing.toX(at));
  dot.setAttribute("cy", drawing.toY(interpolate(curve.x, curve.y, at)));
}

/** Return the value of a curve at a position, linearly interpolated, 0 outside. */
export function interpolate(x, y, at) {
  let [low, high] = [0, x.length - 1];
  if (!(at >= x[low] && at <= x[high])) return 0;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle;
    else high = middle;
  }
  const part = high === low ? 0 : (at - x[low]) / (x[high] - x[low]);
  return y[low] + part * (y[high] - y[low]);
}

/** Return a short line in the style of a curve, for legends, with its mark if it has marks. */
export function swatch(style, hasMarks = false) {
  const line = svgElement("g", { class: `curve style${style % STYLES}` }, svgElement("path", { d: "M0 6h26" }));
  if (hasMarks) line.append(MARKS[style % MARKS.length](13, 6));
  return svgElement("svg", { width: 26, height: 12, "aria-hidden": "true", class: "swatch" }, line);
}

/** Return the image of a content with a width and a height, with a legend of several curves, for files. */
export function imageOf(content, width, height) {
  const { image } = draw(content, width, height);
  const names = (content.curves ?? []).map((curve) => [curve.name, curve.style]);
  if (names.length < 2) return image;
  image.setAttribute("height", height + LINE * names.length + 6);
  for (const [i, [name, style]] of names.entries()) {
    const y = height + LINE * i + 12;
    image.append(svgElement("g", { class: `curve style${style % STYLES}` }, svgElement("path", { d: `M50 ${y - 4}h26` })),
      svgElement("text", { x: 82, y }, name));
  }
  return image;
}

function redraw(host) {
  const entry = drawn.get(host);
  const [width, height] = [host.clientWidth, host.clientHeight];
  if (!entry?.content || !width || !height) return;
  entry.drawing = draw(entry.content, width, height);
  const { image } = entry.drawing;
  const readout = element("div", { class: "readout", hidden: true });
  if (!entry.content.rows) showValuesAtPointer(entry, image, readout);
  host.replaceChildren(image, readout);
  if (entry.at !== undefined) setCursor(host, entry.at);
}

function draw(content, width, height) {
  return content.rows ? drawBars(content, width, height) : drawCurves(content, width, height);
}

function drawCurves(content, width, height) {
  const across = content.x.bands ? [-0.5, content.x.bands.length - 0.5] : rangeOf(content.curves.map((curve) => curve.x));
  const values = content.curves.flatMap((curve) => [curve.y, ...(curve.ends ?? [])]);
  const up = padded(rangeOf([...values, (content.limits ?? []).flat(), content.y.zero ? [0] : []]));
  const marksUp = ticks(up, height / 40);
  const left = 10 + LETTER * Math.max(...marksUp.map((mark) => minus(mark).length));
  const box = { left, right: width - 10, top: 24, bottom: height - 36 };
  const toX = (value) => box.left + ((value - across[0]) / (across[1] - across[0])) * (box.right - box.left);
  const toY = (value) => box.bottom - ((value - up[0]) / (up[1] - up[0])) * (box.bottom - box.top);
  const image = svgElement("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": describeCurves(content) });
  for (const [i, [lower, upper]] of (content.limits ?? []).entries())
    image.append(svgElement("rect", { class: `limits ${content.results?.[i] ?? ""}`, x: toX(i - 0.38), width: toX(0.76) - toX(0), y: toY(upper), height: toY(lower) - toY(upper) }));
  for (const value of marksUp) {
    image.append(svgElement("line", { class: value === 0 ? "axis" : "grid", x1: box.left, x2: box.right, y1: toY(value), y2: toY(value) }));
    image.append(svgElement("text", { class: "quiet", x: box.left - 5, y: toY(value) + 4, "text-anchor": "end" }, minus(value)));
  }
  const marksAcross = content.x.bands ? content.x.bands.map((_, i) => i) : ticks(across, (box.right - box.left) / 60);
  // If the names of bands do not fit, only every second, third … name is shown.
  const spacing = (box.right - box.left) / marksAcross.length;
  const every = content.x.bands ? Math.ceil((LETTER * Math.max(...content.x.bands.map((name) => name.length)) + 6) / spacing) : 1;
  for (const [i, value] of marksAcross.entries()) {
    if (!content.x.bands) image.append(svgElement("line", { class: "grid", x1: toX(value), x2: toX(value), y1: box.top, y2: box.bottom }));
    if (i % every === 0) image.append(svgElement("text", { class: "quiet", x: toX(value), y: box.bottom + 16, "text-anchor": "middle" }, content.x.bands?.[i] ?? minus(value)));
  }
  image.append(svgElement("text", { class: "quiet", x: box.right, y: height - 5, "text-anchor": "end" }, `${content.x.title}, ${content.x.unit}`));
  image.append(svgElement("text", { class: "quiet", x: 2, y: 13 }, `${content.y.title}, ${content.y.unit}${content.y.reference ?? ""}`));
  // The first curve is drawn over the others.
  for (const curve of [...content.curves].reverse()) image.append(curveElement(curve, toX, toY));
  const moment = svgElement("g", { class: "moment", visibility: "hidden" },
    svgElement("line", { y1: box.top, y2: box.bottom }), svgElement("circle", { r: 4.5 }));
  image.append(moment);
  return { image, across, box, toX, toY, moment };
}

function curveElement(curve, toX, toY) {
  const points = curve.x.map((x, i) => [x, curve.y[i]]).filter(([, y]) => y !== null);
  const line = points.map(([x, y]) => `${toX(x).toFixed(1)} ${toY(y).toFixed(1)}`).join("L");
  const group = svgElement("g", { class: `curve style${curve.style % STYLES}${curve.thin ? " thin" : ""}` }, svgElement("path", { d: `M${line}` }));
  for (const [i, ends] of (curve.ends ?? []).entries())
    if (ends.length) group.append(svgElement("path", { class: "bar", d: `M${toX(curve.x[i])} ${toY(ends[0])}V${toY(ends[1])}m-4 0h8M${toX(curve.x[i]) - 4} ${toY(ends[0])}h8` }));
  if (curve.marks) for (const [x, y] of points) group.append(MARKS[curve.style % MARKS.length](toX(x), toY(y)));
  return group;
}

function drawBars(content, width, height) {
  const [low, high] = padded(rangeOf([...content.rows.map(([, ...ends]) => ends), [0]]));
  const isWide = width > 480;
  const left = isWide ? 14 + LETTER * Math.max(...content.rows.map(([title]) => title.length)) : 14;
  const toX = (value) => left + ((value - low) / (high - low)) * (width - 50 - left);
  const room = (height - 44) / content.rows.length;
  const image = svgElement("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": describeRows(content) });
  for (const value of ticks([low, high], (width - left) / 60)) {
    image.append(svgElement("line", { class: value === 0 ? "axis" : "grid", x1: toX(value), x2: toX(value), y1: 4, y2: height - 36 }));
    image.append(svgElement("text", { class: "quiet", x: toX(value), y: height - 20, "text-anchor": "middle" }, minus(value)));
  }
  for (const [i, [title, from, to]] of content.rows.entries()) {
    const y = 6 + room * i;
    const bar = isWide ? { y: y + room * 0.2, height: Math.min(room * 0.6, 20) } : { y: y + 15, height: Math.max(4, Math.min(room - 20, 12)) };
    image.append(svgElement("text", isWide ? { x: left - 8, y: bar.y + bar.height / 2 + 4, "text-anchor": "end" } : { x: 2, y: y + 11 }, title));
    image.append(svgElement("rect", { class: "range", x: toX(Math.min(from, to)), width: Math.max(1.5, Math.abs(toX(to) - toX(from))), ...bar }));
    image.append(svgElement("text", { class: "quiet", x: toX(Math.max(from, to, 0)) + 5, y: bar.y + bar.height / 2 + 4 }, spread(from, to)));
  }
  image.append(svgElement("text", { class: "quiet", x: width - 10, y: height - 4, "text-anchor": "end" }, `${content.x.title}, ${content.x.unit}`));
  return { image };
}

/** Return the text of a range around zero. */
function spread(low, high) {
  const [from, to] = [low, high].map((value) => Math.abs(value).toFixed(1));
  if (from === to) return `±${to}`;
  return [low, high].filter((value) => Math.abs(value) >= 0.05).map((value) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`).join(", ") || "±0.0";
}

/** Show the values of all curves at the pointer. */
function showValuesAtPointer({ content, drawing }, image, readout) {
  const { across, box, toX } = drawing;
  const cursor = svgElement("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  image.append(cursor);
  image.addEventListener("pointermove", (event) => {
    const at = across[0] + ((event.offsetX - box.left) / (box.right - box.left)) * (across[1] - across[0]);
    const isInside = event.offsetX >= box.left && event.offsetX <= box.right;
    if (isInside) showValues(content, at, readout);
    const x = content.x.bands ? toX(Math.round(at)) : event.offsetX;
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    cursor.setAttribute("visibility", isInside ? "visible" : "hidden");
    readout.hidden = !isInside;
    // On the side of the plot away from the cursor.
    readout.classList.toggle("left", event.offsetX > (box.left + box.right) / 2);
  });
  image.addEventListener("pointerleave", () => { readout.hidden = true; cursor.setAttribute("visibility", "hidden"); });
}

function showValues(content, at, readout) {
  const position = content.x.bands ? content.x.bands[Math.min(content.x.bands.length - 1, Math.max(0, Math.round(at)))] : rounded(at);
  const lines = content.curves.map((curve) => {
    const nearest = curve.x.reduce((best, x, i) => (Math.abs(x - at) < Math.abs(curve.x[best] - at) ? i : best), 0);
    return element("div", {}, swatch(curve.style, curve.marks), ` ${rounded(curve.y[nearest], content.y.unit)}`);
  });
  readout.replaceChildren(`${position} ${content.x.unit}`, ...lines);
}

/** Return a description of a plot for screen readers. */
function describeCurves(content) {
  const lines = content.curves.map((curve) => {
    if (content.x.bands) return `${curve.name}: ${curve.y.map((y, i) => `${content.x.bands[i]} ${content.x.unit} ${rounded(y)}`).join(", ")}`;
    return `${curve.name}: maximum ${rounded(Math.max(...curve.y))}`;
  });
  return `${content.y.title}, ${content.y.unit}. ${lines.join("; ")}`;
}

function describeRows(content) {
  return `${content.title}, ${content.x.unit}. ${content.rows.map(([title, low, high]) => `${title} ${spread(low, high)}`).join("; ")}`;
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
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1) values.push(Number((i * step).toPrecision(12)));
  return values;
}
