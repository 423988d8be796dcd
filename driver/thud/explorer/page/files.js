// Files and texts to send: plots, and the case as text.
import { button, byId, element, saveFile, svgElement } from "thud/page.js";
import { contentOf, imageOf } from "thud/plot.js";
import { follow } from "thud/request.js";

// Size of a saved plot, px.
const SIZE = [720, 420];
const PROPERTIES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "font", "text-anchor", "visibility"];

/** Return the image of a plot as text that needs no style sheet, in light colors. */
function svgText(host) {
  const place = element("div", { class: "light" });
  place.style.cssText = "position: absolute; visibility: visible; left: -10000px";
  document.body.append(place);
  try {
    const image = imageOf(contentOf(host), ...SIZE);
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

/** Return a plot as comma-separated values; no text of it is a formula of a spreadsheet. */
function csvText({ curves, limits, x, y }) {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const plain = (value) => (typeof value === "string" ? value.replace(/^[=+\-@]/, "'$&") : String(value ?? ""));
  const lines = (table) => `${table.map((row) => row.map((value) => quoted(plain(value))).join(",")).join("\n")}\n`;
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
    const actions = { SVG: () => saveFile(`${host.id}.svg`, svgText(host), "image/svg+xml"), CSV: () => saveFile(`${host.id}.csv`, csvText(contentOf(host)), "text/csv") };
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

/** Return the content of a file that the server makes of values. */
export const fileOf = (name, values) => follow(`download/${name}`, JSON.stringify(values));
