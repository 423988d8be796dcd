// The curve of a press, from which the modulus of the ball is fitted.
import { button, byId, element, fileZone } from "./page.js";

/** The file that was chosen last, and units of columns whose titles state none. */
const press = { isOpen: false, file: null, units: {} };

/** Fold the choice of a file at the next build of the form. */
export function closePress() {
  press.isOpen = false;
}

/** Return the button of the curve of a press, and what it opens, with the declared fields; `onPress` is called with the form to fit. */
export function pressInputs(declared, onPress) {
  const send = () => {
    const body = new FormData();
    for (const [name, unit] of Object.entries(press.units)) if (unit) body.set(name, unit);
    body.append("file", press.file);
    onPress(body, press.file.name);
  };
  const take = (file) => { press.file = file; byId("press_name").textContent = file.name; send(); };
  const zone = fileZone({ id: "press_zone", input: "press_file", title: "Drop the curve of a press here", label: "Choose file", accept: ".csv,.txt,.tsv,.dat,.xlsx" },
    element("p", { class: "help", id: "press_name" }, press.file?.name ?? "CSV: deflection, mm, and force, N, on the loading branch"), ([file]) => take(file));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    event.stopPropagation();
    document.body.classList.remove("dragging");
    if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
  });
  const fields = declared.map(({ name, label, choices }) => {
    const options = Object.entries({ "": "in the title", ...choices }).map(([value, text]) => element("option", { value }, text));
    const select = element("select", { id: name, "aria-describedby": `${name}.error` }, ...options);
    select.value = press.units[name] ?? "";
    select.addEventListener("change", () => {
      press.units[name] = select.value;
      if (press.file) send();
    });
    return element("div", { class: "field" }, element("label", { for: name }, label), select, element("p", { class: "error", id: `${name}.error` }));
  });
  const panel = element("div", { id: "press", hidden: !press.isOpen }, zone, ...fields);
  const opener = button("Press curve", () => {
    press.isOpen = !press.isOpen;
    panel.hidden = !press.isOpen;
    opener.setAttribute("aria-expanded", String(press.isOpen));
  }, { id: "press_open", "aria-expanded": String(press.isOpen), "aria-controls": "press", title: "Fit the modulus to the force and deflection of a press" });
  return [opener, panel];
}
