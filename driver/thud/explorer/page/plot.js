// Plots of curves against numbers or bands, with limits; drawn at the size of their element.
import { svgElement, element, minus, rounded } from "./page.js";

const MARKS = [
  (x, y) => svgElement("circle", { cx: x, cy: y, r: 4 }),
  (x, y) => svgElement("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7 }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l5 5l-5 5l-5-5z` }),
  (x, y) => svgElement("path", { d: `M${x} ${y - 5}l4.5 8h-9z` }),
];
/** Number of styles of curves. */
export const STYLES = 6;
const shown = new Map();
const watcher = new ResizeObserver((entries) => entries.forEach((entry) => render(entry.target)));

/** Draw a plot in an element.
 *
 * `curves` have name, style, x, y and the options `marks` and `thin`. The axes `x` and `y` have a
 * title and a unit; `x.bands` is a list of names of bands. `limits` are [lower, upper] of each band.
 */
export function plot(host, content) {
  if (!shown.has(host)) watcher.observe(host);
  shown.set(host, content);
  render(host);
}

/** Return a short line in the style of a curve, for legends. */
export function swatch(style) {
  const line = svgElement("line", { x1: 0, y1: 6, x2: 26, y2: 6, class: `curve style${style % STYLES}` });
  return svgElement("svg", { width: 26, height: 12, "aria-hidden": "true" }, line);
}

function render(host) {
  const content = shown.get(host);
  const [width, height] = [host.clientWidth, host.clientHeight];
  if (!content || !width || !height) return;
  const small = width < 260 || height < 160;
  const across = content.x.bands ? [-0.5, content.x.bands.length - 0.5] : range(content.curves.map((curve) => curve.x));
  const up = padded(range([...content.curves.map((curve) => curve.y), (content.limits ?? []).flat(), content.y.zero ? [0] : []]));
  const marksUp = ticks(up, height < 180 ? 4 : 6);
  const letter = small ? 6 : 7.5;
  const left = (small ? 6 : 26) + letter * Math.max(...marksUp.map((mark) => minus(mark).length));
  const box = { left, right: width - 8, top: 8, bottom: height - (small ? 18 : 38) };
  const toX = (value) => box.left + ((value - across[0]) / (across[1] - across[0])) * (box.right - box.left);
  const toY = (value) => box.bottom - ((value - up[0]) / (up[1] - up[0])) * (box.bottom - box.top);
  const image = svgElement("svg", { width, height, role: "img", "aria-label": describe(content), class: small ? "small" : "" });
  for (const [i, [lower, upper]] of (content.limits ?? []).entries())
    image.append(svgElement("rect", { class: "limits", x: toX(i - 0.38), width: toX(0.76) - toX(0), y: toY(upper), height: toY(lower) - toY(upper) }));
  for (const value of marksUp) {
    image.append(svgElement("line", { class: "grid", x1: box.left, x2: box.right, y1: toY(value), y2: toY(value) }));
    image.append(svgElement("text", { x: box.left - 5, y: toY(value) + 4, "text-anchor": "end" }, minus(value)));
  }
  const marksAcross = content.x.bands ? content.x.bands.map((_, i) => i) : ticks(across, (box.right - box.left) / 60);
  // If the names of bands do not fit, only every second, third … name is shown.
  const spacing = (box.right - box.left) / marksAcross.length;
  const every = content.x.bands ? Math.ceil((letter * Math.max(...content.x.bands.map((name) => name.length)) + 4) / spacing) : 1;
  for (const [i, value] of marksAcross.entries()) {
    if (!content.x.bands) image.append(svgElement("line", { class: "grid", x1: toX(value), x2: toX(value), y1: box.top, y2: box.bottom }));
    if (i % every === 0) image.append(svgElement("text", { x: toX(value), y: box.bottom + (small ? 13 : 16), "text-anchor": "middle" }, content.x.bands?.[i] ?? minus(value)));
  }
  if (!small) {
    image.append(svgElement("text", { x: (box.left + box.right) / 2, y: height - 4, "text-anchor": "middle" }, `${content.x.title}, ${content.x.unit}`));
    image.append(svgElement("text", { transform: `translate(12 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, `${content.y.title}, ${content.y.unit}${content.y.reference ?? ""}`));
  }
  for (const curve of content.curves) {
    const points = curve.x.map((x, i) => [x, curve.y[i]]).filter(([, y]) => y !== null);
    const line = points.map(([x, y]) => `${toX(x).toFixed(1)} ${toY(y).toFixed(1)}`).join("L");
    const group = svgElement("g", { class: `curve style${curve.style % STYLES}${curve.thin ? " thin" : ""}` }, svgElement("path", { d: `M${line}` }));
    if (curve.marks) for (const [x, y] of points) group.append(MARKS[curve.style % MARKS.length](toX(x), toY(y)));
    image.append(group);
  }
  const cursor = svgElement("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  image.append(cursor);
  const readout = element("div", { class: "readout", hidden: true });
  image.addEventListener("pointermove", (event) => {
    const at = across[0] + ((event.offsetX - box.left) / (box.right - box.left)) * (across[1] - across[0]);
    showValues(content, at, readout);
    const x = content.x.bands ? toX(Math.round(at)) : event.offsetX;
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    const inside = event.offsetX >= box.left && event.offsetX <= box.right;
    cursor.setAttribute("visibility", inside ? "visible" : "hidden");
    readout.hidden = !inside;
    // On the side of the plot away from the cursor.
    readout.classList.toggle("left", event.offsetX > (box.left + box.right) / 2);
  });
  image.addEventListener("pointerleave", () => { readout.hidden = true; cursor.setAttribute("visibility", "hidden"); });
  host.replaceChildren(image, readout);
}

/** Show the values of all curves at the position `at` of the x axis. */
function showValues(content, at, readout) {
  const position = content.x.bands ? content.x.bands[Math.round(at)] : rounded(at);
  const lines = content.curves.map((curve) => {
    const nearest = curve.x.reduce((best, x, i) => (Math.abs(x - at) < Math.abs(curve.x[best] - at) ? i : best), 0);
    return element("div", {}, swatch(curve.style), ` ${rounded(curve.y[nearest], content.y.unit)}`);
  });
  readout.replaceChildren(`${position} ${content.x.unit}`, ...lines);
}

/** Return a description of a plot for screen readers. */
function describe(content) {
  const lines = content.curves.map((curve) => {
    if (content.x.bands) return `${curve.name}: ${curve.y.map((y, i) => `${content.x.bands[i]} ${content.x.unit} ${rounded(y)}`).join(", ")}`;
    return `${curve.name}: maximum ${rounded(Math.max(...curve.y))}`;
  });
  return `${content.y.title}, ${content.y.unit}. ${lines.join("; ")}`;
}

function range(lists) {
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
