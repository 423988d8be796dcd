// Start of the page: its menu, links, keys and files, and the case with which it begins.
import { byId, button, element, saveFile } from "thud/page.js";
import { ConnectionError, ask, firstAbout, fragment, setFragment, takeFragment } from "thud/request.js";
import { firstVariant } from "thud/first.js";
import { listenToBall } from "thud/ball.js";
import { about, caseValues, fillConstruction, invalidField, isCase, state, takeValues } from "thud/form.js";
import { addFiles, recording } from "thud/recording.js";
import { addPlotButtons, copyText, fileOf } from "thud/files.js";
import { RETRY_INTERVAL, current, hideMessage, holdForClicks, kept, reconnect, showError, showMessage } from "thud/answers.js";
import { commit, restoreStored } from "thud/steps.js";
import { DOORS, formHandlers, keep, move, openDoor, showAll } from "thud/doors.js";

async function copyLink() {
  if (hasInvalidField()) return;
  const door = state.door === "floor" ? "floor" : "ball";
  const text = encodeURIComponent(JSON.stringify({ door, values: caseValues(door) }));
  if (await copyText(`${location.origin}/#case=${text}`, "link.txt")) flash("link", "Link copied");
  showNote("The link holds this case. It works while the server runs, in browsers that have opened the full address shown in the terminal.");
}

/** Show a note in front of the page until it is closed. */
function showNote(text) {
  document.querySelector(".note")?.remove();
  const note = element("div", { class: "task note", role: "status" }, element("span", {}, text), button("Close", () => note.remove()));
  byId("tasks").append(note);
}

function flash(id, text) {
  const target = typeof id === "string" ? byId(id) : id;
  const before = target.textContent;
  if (before === text) return;
  target.textContent = text;
  setTimeout(() => { target.textContent = before; }, 1500);
}

/** Take over the case of a link, as a step that can be undone; show a message if it has none. */
function takeLink(text) {
  let content = null;
  try { content = JSON.parse(text); } catch { /* Not a link of this page. */ }
  const { door, values } = content ?? {};
  if (!["ball", "floor"].includes(door) || !isCase(values)) {
    showMessage("The link does not contain a case; allowed: links copied from this page");
    return;
  }
  commit();
  takeValues(values);
  openDoor(door);
  commit();
}

/** Take over an address that was entered into this page: its token, case or door. */
function onAddress() {
  const parameters = takeFragment();
  hideMessage();
  const door = DOORS.find((name) => name === parameters.get("door"));
  if (parameters.has("case")) takeLink(parameters.get("case"));
  else if (door) openDoor(door);
  else reconnect();
}

function reset() {
  commit();
  kept.list = [];
  recording.files = [];
  Object.assign(current, { recording: null, ball: null, floor: null });
  begin(about.start);
  commit();
}

/** Begin with the values of a case, or with the first model, a slab and the room below. */
function begin(start) {
  Object.assign(state, { values: {}, unknowns: {}, recording: {}, titles: {}, model: "", room: true });
  takeValues({});
  fillConstruction("concrete 180");
  if (Object.keys(start).length) takeValues(start);
  openDoor(start.floor || start.room ? "floor" : "ball");
}

/** Move to the field with an error, of which the message is shown; return whether there is one. */
function hasInvalidField() {
  const input = invalidField();
  input?.focus();
  return Boolean(input);
}

async function download(name, copyButton) {
  if (hasInvalidField()) return;
  const values = caseValues();
  try {
    const file = await fileOf(name, values);
    if (!copyButton) saveFile(name, file);
    else if (await copyText(file, name)) flash(copyButton, "Copied");
    hideMessage();
  } catch (error) { showError(error); }
}

function listen() {
  byId("inputs").addEventListener("focusin", ({ target }) => target.closest(".field")?.scrollIntoView({ block: "nearest" }));
  byId("inputs").addEventListener("submit", (event) => event.preventDefault());
  for (const door of DOORS) byId(`door_${door}`).addEventListener("click", () => openDoor(door));
  byId("doors").addEventListener("keydown", (event) => {
    const at = DOORS.indexOf(state.door);
    const next = { ArrowRight: (at + 1) % 3, ArrowLeft: (at + 2) % 3, Home: 0, End: 2 }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    openDoor(DOORS[next], { focus: true });
  });
  byId("keep").addEventListener("click", keep);
  byId("undo").addEventListener("click", () => move(-1));
  byId("redo").addEventListener("click", () => move(1));
  byId("reset").addEventListener("click", reset);
  byId("link").addEventListener("click", copyLink);
  byId("print").addEventListener("click", () => print());
  addEventListener("beforeprint", () => { byId("warnings_section").open = true; });
  byId("thirds").addEventListener("change", ({ target }) => { state.view.thirds = target.checked; showAll(); });
  for (const target of document.querySelectorAll("[data-file], [data-copy]")) {
    const { file, copy } = target.dataset;
    target.addEventListener("click", () => download(file ?? copy, copy && target));
  }
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") { for (const menu of document.querySelectorAll(".menu[open]")) { menu.open = false; menu.firstElementChild.focus(); } }
    // A field for text has steps of its own.
    if (!(event.ctrlKey || event.metaKey) || event.target.matches?.("input[type=text]")) return;
    const isRedo = event.key === "y" || (event.key.toLowerCase() === "z" && event.shiftKey);
    if (event.key.toLowerCase() !== "z" && !isRedo) return;
    event.preventDefault();
    move(isRedo ? 1 : -1);
  });
  addEventListener("pagehide", () => { document.activeElement?.blur(); commit(); });
  addEventListener("click", (event) => { for (const menu of document.querySelectorAll(".menu[open]")) if (!menu.contains(event.target) || event.target.closest("button")) menu.open = false; });
  addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dragging"); });
  addEventListener("dragleave", () => document.body.classList.remove("dragging"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dragging");
    if (!event.dataTransfer.files.length) return;
    const files = [...event.dataTransfer.files];
    if (state.door !== "recording") openDoor("recording");
    addFiles(files, formHandlers.onChange);
  });
  listenToBall();
}

/** Show only the message until a token arrives in this page or another; then load the page. */
function awaitToken() {
  document.body.classList.add("locked");
  setTimeout(() => ask("about").then(() => location.reload(), () => {}), RETRY_INTERVAL);
  addEventListener("storage", ({ key }) => { if (key === "token") location.reload(); });
  addEventListener("hashchange", () => {
    const parameters = takeFragment();
    setFragment(String(parameters.size ? parameters : fragment));
    location.reload();
  });
}

async function main() {
  // Doors may be chosen before the rest has arrived.
  let chosen = null;
  const choose = ({ target }) => { chosen = target.closest("[role=tab]")?.id.replace("door_", "") ?? chosen; };
  byId("doors").addEventListener("click", choose);
  try {
    Object.assign(about, await firstAbout);
  } catch (error) {
    byId("verdict").replaceChildren();
    document.body.classList.add("outdated");
    byId("panel").setAttribute("aria-busy", "false");
    showMessage(error.message);
    if (error instanceof ConnectionError) awaitToken();
    return;
  }
  byId("tools").hidden = false;
  addPlotButtons();
  listen();
  holdForClicks();
  const link = fragment.get("case");
  const door = DOORS.find((name) => name === fragment.get("door"));
  if (firstVariant) current[firstVariant.door] = firstVariant;
  const isRestored = restoreStored();
  if (isRestored) openDoor(door ?? state.door);
  else begin(about.start);
  commit();
  addEventListener("hashchange", onAddress);
  if (link !== null) takeLink(link);
  else if (door && !isRestored) openDoor(door);
  byId("doors").removeEventListener("click", choose);
  if (chosen) openDoor(chosen);
  commit();
}

main();
