// Files to save: the values of plots, and what the server makes of a case.
import { button, saveFile } from "thud/page.js";
import { contentOf } from "thud/plot.js";
import { follow } from "thud/request.js";

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

/** Add a button to each plot that saves its values. */
export function addPlotButtons() {
  for (const host of document.querySelectorAll(".plot")) {
    const title = host.parentElement.querySelector("h2").firstChild.textContent.trim();
    const save = () => saveFile(`${host.id}.csv`, csvText(contentOf(host)), "text/csv");
    host.parentElement.querySelector(".tools").append(
      button("CSV", save, { title: "Save the values", "aria-label": `Save as CSV: ${title}` }));
  }
}

/** Copy a text; save it as a file where the browser does not allow that. */
export async function copyText(text, name) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    saveFile(name, text);
    return false;
  }
}

/** Return the content of a file that the server makes of values. */
export const fileOf = (name, values) => follow(`download/${name}`, JSON.stringify(values));
