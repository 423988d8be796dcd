// Plots of curves against numbers or bands, drawn at the size of their element. A button of the
// legend hides the curve with the same index in all plots.
const DASHES = { solid: "", dash: "8 4", dashdot: "8 3 2 3", dot: "2 3", longdashdot: "14 3 2 3", "2px,2px": "2 2", longdash: "14 4" };
const MARKS = {
  circle: "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0", square: "M-3.5 -3.5h7v7h-7z", "triangle-up": "M0 -5l4.5 8h-9z",
  diamond: "M0 -5l5 5l-5 5l-5 -5z", "triangle-down": "M0 5l4.5 -8h-9z", cross: "M-1.5 -5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5v-3h3.5z",
  x: "M-4.5 -3l1.5 -1.5l3 3l3 -3l1.5 1.5l-3 3l3 3l-1.5 1.5l-3 -3l-3 3l-1.5 -1.5l3 -3z",
};
const LETTER = 7.5;
const hidden = new Set();
const hosts = [];

function fill(target, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) target.setAttribute(key, value);
  target.append(...children);
  return target;
}
const html = (name, attributes, ...children) => fill(document.createElement(name), attributes, children);
const svg = (name, attributes, ...children) => fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
const text = (value) => String(Number(value.toPrecision(4))).replace(/-/g, "−");
const color = (curve) => (curve.line.color === "#000000" ? "var(--text)" : curve.line.color);

/** Return round values within a range, about `count` of them; of a logarithmic axis, powers of ten. */
function ticks([low, high], count, logarithmic) {
  if (logarithmic) {
    const step = Math.max(1, Math.ceil((high - low) / count));
    return Array.from({ length: Math.floor(high) - Math.ceil(low) + 1 }, (_, i) => Math.ceil(low) + i).filter((i) => i % step === 0);
  }
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * (1 - 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

function range(values, margin) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = finite.length ? [Math.min(...finite), Math.max(...finite)] : [0, 1];
  const pad = margin * (high - low || Math.abs(high) || 1);
  return [low - pad, high + pad];
}

function draw(host) {
  const { plot, area, readout } = host;
  const [width, height] = [area.clientWidth, area.clientHeight];
  if (!width || !height) return;
  const { xaxis, yaxis } = plot.layout;
  const curves = plot.data.map((curve, index) => ({ ...curve, index })).filter((curve) => !hidden.has(curve.index));
  const lines = curves.filter((curve) => curve.type !== "bar");
  const bars = curves.filter((curve) => curve.type === "bar");
  const names = xaxis.type === "category" ? plot.data[0].x : null;
  const logarithmic = yaxis.type === "log";
  const up = (value) => (logarithmic ? Math.log10(value) : value);
  const across = names ? [-0.5, names.length - 0.5] : range(lines.flatMap((curve) => curve.x), 0);
  const heights = [...lines.flatMap((curve) => curve.y), ...bars.flatMap((bar) => bar.base.flatMap((low, i) => [low, low + bar.y[i]]))];
  const span = range(heights.map(up), 0.05);
  const marks = ticks(span, 6, logarithmic);
  const label = (mark) => (logarithmic ? `1e${text(mark)}` : text(mark));
  const titles = yaxis.title.text.split("<br>");
  const box = { left: 14 * titles.length + 12 + LETTER * Math.max(...marks.map((mark) => label(mark).length)), right: width - 8, top: 8, bottom: height - 42 };
  const toX = (value) => box.left + ((value - across[0]) / (across[1] - across[0])) * (box.right - box.left);
  const toY = (value) => box.bottom - ((value - span[0]) / (span[1] - span[0])) * (box.bottom - box.top);
  const position = (curve, i) => (names ? i : curve.x[i]);
  const image = svg("svg", { width, height, role: "img", "aria-label": `${titles.join(" ")}: ${lines.map((curve) => curve.name).join("; ")}` });
  for (const bar of bars)
    for (const [i, low] of bar.base.entries())
      image.append(svg("rect", { class: "band", x: toX(i - 0.38), width: toX(0.76) - toX(0), y: toY(low + bar.y[i]), height: toY(low) - toY(low + bar.y[i]) }));
  for (const mark of marks)
    image.append(svg("line", { class: "grid", x1: box.left, x2: box.right, y1: toY(mark), y2: toY(mark) }), svg("text", { x: box.left - 5, y: toY(mark) + 4, "text-anchor": "end" }, label(mark)));
  const columns = names ? names.map((_, i) => i) : ticks(across, Math.max(2, Math.floor((box.right - box.left) / 70)));
  const longest = LETTER * Math.max(...columns.map((mark) => (names ? names[mark] : text(mark)).length)) + 6;
  const every = Math.ceil((longest * columns.length) / (box.right - box.left));
  for (const [i, mark] of columns.entries()) {
    image.append(svg("line", { class: "grid", x1: toX(mark), x2: toX(mark), y1: box.top, y2: box.bottom }));
    if (i % every === 0) image.append(svg("text", { x: toX(mark), y: box.bottom + 17, "text-anchor": "middle" }, names ? names[mark] : text(mark)));
  }
  image.append(svg("text", { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }, xaxis.title.text));
  for (const [i, title] of titles.entries())
    image.append(svg("text", { transform: `translate(${13 + 14 * i} ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, title));
  for (const curve of lines) {
    const points = curve.y.map((y, i) => [toX(position(curve, i)), toY(up(y))]).filter((point) => point.every(Number.isFinite));
    const path = points.map((point) => point.map((value) => value.toFixed(1)).join(" ")).join("L");
    image.append(svg("path", { d: `M${path}`, fill: "none", stroke: color(curve), "stroke-width": curve.line.width ?? 2, "stroke-dasharray": DASHES[curve.line.dash] }));
    if (curve.mode.includes("markers"))
      for (const [x, y] of points) image.append(svg("path", { d: MARKS[curve.marker.symbol], transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})`, fill: color(curve) }));
  }
  const cursor = svg("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  image.append(cursor);
  image.addEventListener("pointermove", (event) => {
    const at = across[0] + ((event.offsetX - box.left) / (box.right - box.left)) * (across[1] - across[0]);
    const inside = event.offsetX >= box.left && event.offsetX <= box.right;
    const x = names ? Math.round(at) : at;
    for (const key of ["x1", "x2"]) cursor.setAttribute(key, toX(x));
    cursor.setAttribute("visibility", inside ? "visible" : "hidden");
    readout.hidden = !inside;
    readout.classList.toggle("left", at > (across[0] + across[1]) / 2);
    const rows = lines.map((curve) => {
      const nearest = curve.y.reduce((best, _, i) => (Math.abs(position(curve, i) - at) < Math.abs(position(curve, best) - at) ? i : best), 0);
      return html("div", {}, swatch(curve), ` ${text(curve.y[nearest])}`);
    });
    readout.replaceChildren(`${names ? names[x] : text(x)}, ${xaxis.title.text}`, ...rows);
  });
  image.addEventListener("pointerleave", () => { readout.hidden = true; cursor.setAttribute("visibility", "hidden"); });
  area.replaceChildren(image);
}

/** Return a short line in the style of a curve, or a box in the color of a bar. */
function swatch(curve) {
  const mark = curve.type === "bar"
    ? svg("rect", { class: "band", width: 30, height: 12 })
    : svg("path", { d: "M0 6h30", stroke: color(curve), "stroke-width": 2, "stroke-dasharray": DASHES[curve.line.dash] });
  const image = svg("svg", { width: 30, height: 12, "aria-hidden": "true" }, mark);
  if (curve.mode?.includes("markers")) image.append(svg("path", { d: MARKS[curve.marker.symbol], transform: "translate(15 6)", fill: color(curve) }));
  return image;
}

function legend(target, plots) {
  for (const plot of plots)
    for (const [index, curve] of plot.data.entries()) {
      if (!curve.showlegend) continue;
      if (curve.type === "bar") {
        target.append(html("span", {}, swatch(curve), ` ${curve.name}`));
        continue;
      }
      const button = html("button", { type: "button", "aria-pressed": "true" }, swatch(curve), ` ${curve.name}`);
      button.addEventListener("click", () => {
        if (!hidden.delete(index)) hidden.add(index);
        button.setAttribute("aria-pressed", String(!hidden.has(index)));
        hosts.forEach(draw);
      });
      target.append(button);
    }
}

function drawPlots(plots) {
  const watcher = new ResizeObserver((entries) => entries.forEach((entry) => draw(hosts.find((host) => host.area === entry.target))));
  legend(document.querySelector(".legend"), plots);
  for (const plot of plots) {
    const area = html("div", { class: "area" });
    const readout = html("div", { class: "readout" });
    readout.hidden = true;
    document.querySelector(".plots").append(html("div", {}, area, readout));
    hosts.push({ plot, area, readout });
    watcher.observe(area);
  }
}
