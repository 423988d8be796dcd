// Files and texts to send: plots, the page of all variants, and the case as text.
import { button, byId, element, rounded, saveFile, svgElement } from "./page.js";
import { contentOf, imageOf } from "./plot.js";
import { ask } from "./request.js";
import { headlineText } from "./results.js";
import { inputRows } from "./variants.js";

// Sizes of saved plots, and of those of a page, which stand side by side on wide screens, px.
const SIZE = [720, 420];
const PAGE_SIZE = [400, 300];
const PROPERTIES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "font", "text-anchor", "visibility"];

/** Return the image of a plot as text that needs no style sheet, in light colors. */
function svgText(host, size = SIZE) {
  const place = element("div", { class: "light" });
  place.style.cssText = "position: absolute; visibility: visible; left: -10000px";
  document.body.append(place);
  try {
    const image = imageOf(contentOf(host), ...size);
    place.append(image);
    const parts = [...image.querySelectorAll("*")];
    const styles = parts.map((part) => PROPERTIES.map((name) => getComputedStyle(part).getPropertyValue(name)));
    for (const [i, part] of parts.entries()) {
      PROPERTIES.forEach((name, k) => part.style.setProperty(name, styles[i][k]));
      part.removeAttribute("class");
    }
    for (const hidden of image.querySelectorAll("[visibility=hidden]")) hidden.remove();
    const [width, height] = ["width", "height"].map((name) => image.getAttribute(name));
    image.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    image.setAttribute("viewBox", `0 0 ${width} ${height}`);
    image.style.background = "#ffffff";
    image.prepend(svgElement("title", {}, contentOf(host).title));
    return new XMLSerializer().serializeToString(image);
  } finally {
    place.remove();
  }
}

async function savePng(host, name) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svgText(host))}`;
  await image.decode();
  const canvas = element("canvas", { width: 2 * image.width, height: 2 * image.height });
  const context = canvas.getContext("2d");
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  canvas.toBlob((blob) => saveFile(`${name}.png`, blob));
}

/** Return the curves of a plot as comma-separated values, with limits and ends of ranges; no text of it is a formula of a spreadsheet. */
function csvText({ rows, curves, limits, x, y }) {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const plain = (value) => (typeof value === "string" ? value.replace(/^[=+\-@]/, "'$&") : String(value ?? ""));
  const lines = (table) => `${table.map((row) => row.map((value) => quoted(plain(value))).join(",")).join("\n")}\n`;
  if (rows) return lines([["contribution", `low, ${x.unit}`, `high, ${x.unit}`], ...rows]);
  const columns = curves.map((curve) => `${curve.name}, ${y.unit}`);
  if (x.bands) {
    const table = curves.flatMap(({ y: values, ends = [] }, k) => [[columns[k], ...values],
      ...(ends.some((pair) => pair.length) ? ["low", "high"].map((name, i) => [`${curves[k].name}, ${name} (95 %), ${y.unit}`, ...ends.map((pair) => pair[i])]) : [])]);
    if (limits) table.push(...["lower", "upper"].map((name, i) => [`${name} limit, ${y.unit}`, ...limits.map((pair) => pair[i])]));
    return lines([`${x.title}, ${x.unit}`, ...x.bands].map((band, i) => [band, ...table.map((column) => column[i])]));
  }
  // Each curve has times of its own.
  const length = Math.max(...curves.map((curve) => curve.x.length));
  return lines([columns.flatMap((name) => [`${x.title}, ${x.unit}`, name]), ...Array.from({ length }, (_, i) => curves.flatMap((curve) => [curve.x[i], curve.y[i]]))]);
}

/** Add a menu to each plot that saves it. */
export function addPlotMenus() {
  for (const host of document.querySelectorAll(".plot")) {
    const title = host.parentElement.querySelector("h2").firstChild.textContent.trim();
    const actions = { SVG: () => saveFile(`${host.id}.svg`, svgText(host), "image/svg+xml"), PNG: () => savePng(host, host.id), CSV: () => saveFile(`${host.id}.csv`, csvText(contentOf(host)), "text/csv") };
    host.parentElement.querySelector(".tools").append(element("details", { class: "menu" }, element("summary", { "aria-label": `Save the plot: ${title}` }, "Save"),
      element("div", {}, ...Object.entries(actions).map(([name, save]) => button(name, save)))));
  }
}

/** Copy a text; where the browser does not allow it, show it. */
export async function copyText(text, title) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    byId("copy_title").textContent = title;
    byId("copy_text").value = text;
    byId("copy_dialog").showModal();
    byId("copy_text").select();
    return false;
  }
}

/** Return a file that the server makes of values. */
export async function fileOf(name, values) {
  return (await ask(`download/${name}`, { method: "POST", body: JSON.stringify(values) })).blob();
}

const STYLE = `:root { color-scheme: light; } body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem; color: #1b1d1f; background: #fff; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.1rem; margin: 1.6rem 0 .4rem; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; } caption { text-align: left; font-weight: 600; padding-top: .6rem; }
th, td { border-bottom: 1px solid #dcdfe2; padding: .2rem .9rem .2rem 0; text-align: right; } th:first-child { text-align: left; position: sticky; left: 0; background: #fff; } tbody th { font-weight: 400; }
.scroll { overflow-x: auto; background: linear-gradient(to left, #fff 50%, transparent) right / 2.4rem 100% no-repeat local, linear-gradient(to left, #83898f, transparent) right / .8rem 100% no-repeat scroll; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); gap: 0 1rem; }
figure { margin: 1rem 0; break-inside: avoid; } figcaption { font-weight: 600; } figure svg { width: 100%; height: auto; } small { color: #565c62; } td small { display: block; } .curve { stroke-width: 2; }
.conforms { color: #00583f; } .does_not_conform { color: #9a2c00; } .undecided { color: #6b4a00; }`;

/** Return a page of its own with headline, inputs, criteria, plots and warnings of all variants. */
export function pageOf(variants, version) {
  const page = document.implementation.createHTMLDocument("thud");
  const table = (id) => {
    const copy = byId(id).cloneNode(true);
    copy.removeAttribute("id");
    const [lines, copies] = [byId(id), copy].map((part) => [...part.querySelectorAll(".swatch .curve")]);
    copies.forEach((line, i) => { for (const name of ["stroke", "stroke-dasharray"]) line.setAttribute(name, getComputedStyle(lines[i]).getPropertyValue(name)); });
    for (const control of copy.querySelectorAll("button")) control.replaceWith(control.classList.contains("remove") ? "" : control.textContent);
    return element("div", { class: "scroll" }, copy);
  };
  const plots = [...document.querySelectorAll(".plot")].filter((host) => host.clientWidth);
  const figures = plots.map((host) => element("figure", {}, element("figcaption", {}, contentOf(host).title), element("slot", { name: host.id })));
  const [first] = variants;
  page.body.append(
    element("h1", { class: first.answer.headline.result }, `${first.label}: ${headlineText(first.answer)}`), element("p", {}, first.answer.headline.detail ?? ""),
    ...(variants.length > 1 ? [element("h2", {}, "Comparison"), table("variants")] : []),
    element("div", { class: "figures" }, ...figures),
    ...(byId("criteria_section").offsetParent ? [element("h2", {}, "Criteria"), table("criteria"), element("p", {}, byId("criteria_text").textContent)] : []),
    element("h2", {}, "Results"),
    ...variants.map(({ label, answer }) => element("p", {}, `${label}: ${[headlineText(answer), ...[...answer.numbers, ...(answer.floor?.numbers ?? [])].map(([name, value, unit]) => `${name} ${rounded(value, unit)}`)].join("; ")}`)),
    ...variants.filter(({ answer }) => answer.room).map(({ label, answer }) => element("p", {}, `${label}: ${answer.room.ratings}`)),
    element("h2", {}, "Inputs"),
    ...variants.map(({ label, values, stated }) => element("div", { class: "scroll" }, element("table", {}, element("caption", {}, label),
      ...(values ? inputRows(values) : stated ?? []).map(([name, text]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, text)))))),
    ...variants.filter(({ answer }) => answer.warnings.length).flatMap(({ label, answer }) => [element("h2", {}, `Warnings: ${label}`), element("ul", {}, ...answer.warnings.map((text) => element("li", {}, text)))]),
    element("p", {}, element("small", {}, `thud ${version}, ${new Date().toISOString().slice(0, 10)}. Values not listed are the defaults.`)));
  for (const node of page.querySelectorAll("[title]")) node.removeAttribute("title");
  // As text, since the policy of this page would forbid the styles of the other one.
  const title = element("title", {}, `thud: ${first.label}`).outerHTML;
  const body = plots.reduce((text, host) => text.replace(`<slot name="${host.id}"></slot>`, () => svgText(host, PAGE_SIZE)), page.body.outerHTML);
  return `<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">${title}<style>${STYLE}</style></head>\n${body}</html>\n`;
}
