// The curve of a press, from which the modulus of the ball is fitted.
import { element, fileZone } from "thud/page.js";

const HELP = "Deflection and force, with units in the titles, such as “Deflection, mm” and “Force, N”. "
  + "The loading branch determines the modulus, with radius and wall as stated; a press measures "
  + "slowly: in an impact rubber is stiffer";

/** Return the folded choice of a file; `onPress` is called with the form to fit and its name. */
export function pressInputs(onPress) {
  const take = ([file]) => {
    const body = new FormData();
    body.append("file", file);
    onPress(body, file.name);
  };
  const zone = fileZone(
    {
      id: "press_zone", input: "press_file", title: "Drop the curve of a press here",
      accept: ".csv,.txt,.tsv,.dat,.xlsx",
    }, HELP, take);
  zone.addEventListener("drop", (event) => {
    // It is no recording.
    event.preventDefault();
    event.stopPropagation();
    document.body.classList.remove("dragging");
    if (event.dataTransfer.files.length) take(event.dataTransfer.files);
  });
  return element("details", { id: "press" }, element("summary", {}, "Press curve"), zone);
}
