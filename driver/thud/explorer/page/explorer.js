// Main module of the page: sends the values of the form to the server and shows the latest answer.
import { byId, button, element, saveFile } from "./page.js";
import { ConnectionError, ServerError, ask, firstAbout, follow, fragment, requestAbout, units } from "./request.js";
import { hideTip, showCriteria, showFloors, showForces, showHeadline, showRooms, showWarnings } from "./results.js";
import { STORE, firstVariant } from "./first.js";
import { listenToBall, showBall } from "./ball.js";
import { about, caseValues, isCase, markField, state, takeValues } from "./form.js";
import { closePress } from "./press.js";
import { addFiles, buildDoor, isLaboratory, recording, recordingBody, showAsks } from "./recording.js";
import { freeStyle, nameVariants, showVariants } from "./variants.js";
import { showSounds } from "./listen.js";
import { addPlotMenus, copyText, fileOf, pageOf } from "./files.js";

// Pause after a change before a slow case is requested, and before a change can be undone, ms.
const PAUSE = 120;
const COMMIT_PAUSE = 400;
// Time between attempts to reach the server, ms.
const RETRY_INTERVAL = 1500;
const RECORDING_TEXT = "Choose the record of one drop or more. The answer is the verdict with its uncertainty, the levels within the limits of the standards, and a calibration report to save. Missing values can be stated afterwards: the page asks for those that matter.";
const DOORS = ["recording", "ball", "floor"];
// The current variant of each door, and those that were kept.
const current = { recording: null, ball: null, floor: null };
let kept = [];
// Text on the last fit, and the values that it belongs to.
let fitted = { text: "", details: "", values: "", name: "" };
let job = null;
let timer = 0;
let retryTimer = 0;

// ---- Messages.

function showMessage(message) {
  byId("message").textContent = message;
  byId("message").hidden = false;
}

function hideMessage() {
  byId("message").hidden = true;
  markField(null);
}

/** Mark the results as those of other values than the current ones. */
function setOutdated(isOutdated, isBusy = isOutdated) {
  document.body.classList.toggle("outdated", isOutdated);
  byId("panel").setAttribute("aria-busy", String(isBusy));
}

/** Show that a field has no valid value; without a name, that it is being typed. */
function onInvalid(name, message) {
  setOutdated(true, false);
  if (!name) return;
  hideMessage();
  markField(name, message);
  showMessage(message);
}

/** Show an error; if the server cannot be reached, try again later. */
function showError(error) {
  if (error.name === "AbortError") return;
  if (!(error instanceof ConnectionError || error instanceof ServerError)) throw error;
  showMessage(error.message);
  markField(error.field, error.message);
  if (error instanceof ConnectionError) {
    clearTimeout(retryTimer);
    retryTimer = setTimeout(() => ask("about").then(() => { hideMessage(); solve(); }, showError), RETRY_INTERVAL);
  }
}

// ---- Tasks of the server.

/** Return the answer of a task; show its progress and a button to cancel it, by default from its first report. */
async function runTask(name, path, body, controller, { showNow = false, onReport = () => {} } = {}) {
  const bar = element("progress", { max: 1, "aria-label": name });
  const line = element("div", { class: "task" }, element("span", {}, name), bar, button("Cancel", () => controller.abort()));
  const showTask = () => { if (!line.isConnected) byId("tasks").append(line); };
  if (showNow) showTask();
  try {
    return await follow(path, body, controller.signal, (fraction) => {
      showTask();
      if (fraction > 0) bar.value = fraction;
      onReport();
    });
  } finally {
    line.remove();
  }
}

/** Compute the case or assess the recording, after cancelling a slow computation or waiting for a quick one. */
async function solve() {
  clearTimeout(timer);
  if (job && !job.slow) { job.repeat = true; return; }
  job?.controller.abort();
  const { door } = state;
  const isRecording = door === "recording";
  if (isRecording && !recording.files.length) { current.recording = null; setOutdated(false); showAll(); return; }
  const thisJob = { controller: new AbortController(), slow: isRecording, repeat: false, start: performance.now() };
  job = thisJob;
  byId("panel").setAttribute("aria-busy", "true");
  // A quick answer comes before the eye would see the change.
  const dimming = setTimeout(() => setOutdated(true), PAUSE);
  try {
    const values = isRecording ? null : caseValues(door);
    const body = isRecording ? checkedBody() : JSON.stringify(values);
    const answer = isRecording
      ? await runTask(`Assessing ${recording.files.map(({ name }) => name).join(", ")}`, "measure", body, thisJob.controller, { showNow: true })
      : await runTask("Computing", "solve", body, thisJob.controller, { onReport: () => { thisJob.slow = true; setOutdated(true); } });
    clearTimeout(dimming);
    if (isRecording) current.recording = recordedVariant(answer, body);
    else current[door] = { door, style: 0, values, chosen: state.chosen, answer, slow: thisJob.slow, ...(door === "ball" && fitted.name && JSON.stringify(values) === fitted.values ? { title: fitted.name } : {}) };
    if (state.door !== door || job !== thisJob) return;
    hideMessage();
    setOutdated(false, thisJob.repeat);
    showAll();
    commitSoon();
    // Time from the request to the next frame, for tests and benchmarks.
    requestAnimationFrame(() => { document.body.dataset.latency = String(performance.now() - thisJob.start); });
  } catch (error) {
    clearTimeout(dimming);
    if (job === thisJob) setOutdated(true, false);
    showError(error);
    if (isRecording && state.door === door && about.recording.some((field) => field.name === error.field)) showAsks([{ reason: "", values: { [error.field]: "" } }], onChange);
  } finally {
    if (job === thisJob) {
      job = null;
      if (thisJob.repeat) solve();
    }
  }
}

/** Return the body of a request with the recording; throw ServerError if a file is too large. */
function checkedBody(values) {
  const large = recording.files.find(({ size }) => size > about.max_recording);
  if (large) throw new ServerError({ error: `${large.name} is larger than ${about.max_recording / 1e6} MB; allowed: less` });
  return recordingBody(values);
}

function recordedVariant(answer, body) {
  const [{ name }, ...others] = recording.files.filter((file) => !isLaboratory(file));
  const drops = `${answer.drops} drop${answer.drops === 1 ? "" : "s"}`;
  const stated = Object.entries(state.recording).map(([key, text]) => [about.recording.find((field) => field.name === key)?.label ?? key, text]);
  return { door: "recording", style: 0, name: `${others.length ? `${name} and ${others.length} more` : name}, ${drops}`, stated, answer, body };
}

/** Compute the case after a change of the form; a slow case only after a pause. */
function onChange() {
  commitSoon();
  hideMessage();
  const isSlow = (job ?? current[state.door])?.slow || state.door === "recording";
  if (!isSlow) { solve(); return; }
  job?.controller.abort();
  setOutdated(true);
  clearTimeout(timer);
  timer = setTimeout(solve, PAUSE);
}

// ---- Results.

/** Return the variants of the current door, its own first. */
function variantsOfDoor() {
  const { door } = state;
  const own = current[door];
  if (door === "floor") return [own, ...kept.filter((variant) => variant.door === "floor")].filter(Boolean);
  const others = kept.filter((variant) => variant.door !== "floor");
  if (door === "ball" && current.recording) others.unshift({ ...current.recording, style: freeStyle(others) });
  return [own, ...others].filter(Boolean);
}

/** Show the answers of the current door. */
function showAll() {
  const { door } = state;
  const variants = variantsOfDoor();
  const own = current[door];
  const isEmpty = !own;
  document.body.dataset.door = door;
  document.body.classList.toggle("measured", Boolean(current.recording));
  hideTip();
  byId("variants_section").hidden = variants.length < 2;
  byId("keep").hidden = isEmpty;
  byId("next").replaceChildren();
  byId("result").replaceChildren();
  byId("improvement").replaceChildren(...improveButton(own));
  showAsks(own && door === "recording" ? own.answer.asks : [], onChange);
  if (isEmpty) {
    showNothing(door);
    return;
  }
  nameVariants(variants);
  const options = { thirds: byId("thirds").checked, differences: byId("differences").checked };
  showHeadline(own);
  showWarnings(own);
  const hasRoom = Boolean(own.answer.room);
  byId("levels_figure").hidden = hasRoom;
  byId("force_figure").hidden = hasRoom;
  byId("force_figure").classList.toggle("second", !hasRoom);
  byId("criteria_section").hidden = door === "floor";
  showPlots(variants, options);
  showFloors(variants);
  if (door !== "floor") showCriteria(variants);
  showBall(door === "recording" ? null : own.answer.motion);
  showVariants(variants, { remove: removeVariant, rename: renameVariant });
  showSounds(hasRoom ? variants : [], showError);
  if (door === "recording") byId("next").append(button("Calibration report", () => saveReport(own), { class: "strong", id: "report" }), button("Fit a ball to this recording", fit, { id: "fit" }));
  if (door === "ball" && JSON.stringify(own.values) === fitted.values) showFitTexts();
  if (door === "ball") byId("next").append(button("Drop it on a floor", () => openDoor("floor")));
}

/** Show the plots of room or force. */
function showPlots(variants, options) {
  showRooms(variants, options);
  if (!variants[0].answer.room) showForces(variants, options);
}

/** Show the result of the last fit, and its details folded; at first in sight. */
function showFitTexts() {
  const { text, details, isNew } = fitted;
  byId("result").append(element("p", {}, text), ...(details ? [element("details", {}, element("summary", {}, "How well it fits"), element("p", { class: "help" }, details))] : []));
  if (isNew) byId("result").scrollIntoView({ block: "nearest" });
  fitted.isNew = false;
}

/** Show the door without an answer. */
function showNothing(door) {
  byId("verdict").className = "";
  byId("verdict").replaceChildren(element("b", {}, door === "recording" ? "Does my source conform?" : "Computing …"));
  byId("detail").textContent = door === "recording" ? RECORDING_TEXT : "";
  delete byId("detail").dataset.subject;
  byId("open_warnings").replaceChildren();
  for (const id of ["warnings_section", "ball_section", "room_figure", "contributions_figure", "ratings_section", "floor_section", "sound_section"]) byId(id).hidden = true;
  for (const id of ["levels_figure", "force_figure", "criteria_section"]) byId(id).hidden = door === "recording";
}

// ---- Variants.

function keep() {
  const own = current[state.door];
  if (!own) return;
  kept = [...kept, { ...own, style: freeStyle(variantsOfDoor()) }];
  showAll();
  commit();
}

function removeVariant(variant) {
  if (kept.includes(variant)) kept = kept.filter((other) => other !== variant);
  else current.recording = null;
  showAll();
  byId("keep").focus();
  commit();
}

/** Give a variant a name of the user; an empty one takes it back, and null changes nothing. */
function renameVariant(variant, text) {
  if (text === "") delete variant.title;
  else if (text !== null && text !== variant.label) variant.title = text;
  showAll();
  store();
}

// ---- Doors, history, storage and link.

/** Open a door, and compute its case if that is not known. */
function openDoor(door, { focus = false } = {}) {
  job?.controller.abort();
  job = null;
  state.door = door;
  for (const name of DOORS) {
    const tab = byId(`door_${name}`);
    tab.setAttribute("aria-selected", String(name === door));
    tab.tabIndex = name === door ? 0 : -1;
    if (name === door && focus) tab.focus();
  }
  byId("panel").setAttribute("aria-labelledby", `door_${door}`);
  history.replaceState(null, "", `#${door}`);
  document.body.dataset.door = door;
  buildDoor({ onChange, onInvalid, onPress });
  hideMessage();
  const isCurrent = Boolean(current[door]) && (door === "recording" || JSON.stringify(current[door].values) === JSON.stringify(caseValues(door)));
  showAll();
  setOutdated(!isCurrent && Boolean(current[door]), !isCurrent);
  if (!isCurrent || current[door].isPartial) solve();
  commitSoon();
}

const steps = { list: [], at: -1, timer: 0 };
const snapshot = () => ({ state: JSON.stringify(state), kept, recorded: current.recording, files: recording.files });

function commitSoon() {
  clearTimeout(steps.timer);
  steps.timer = setTimeout(commit, COMMIT_PAUSE);
}

/** Remember the case and its variants, so that a change can be undone. */
function commit() {
  clearTimeout(steps.timer);
  const [last, next] = [steps.list[steps.at], snapshot()];
  const isEqual = last && last.kept === next.kept && last.files === next.files && sameCase(last.state, next.state);
  store();
  if (isEqual) return;
  steps.list.splice(steps.at + 1, Infinity, next);
  steps.at = steps.list.length - 1;
  showSteps();
}

function sameCase(one, other) {
  const text = (entry) => JSON.stringify({ ...JSON.parse(entry), moved: null, door: null });
  return text(one) === text(other);
}

function showSteps() {
  byId("undo").disabled = steps.at <= 0;
  byId("redo").disabled = steps.at >= steps.list.length - 1;
}

function goTo(at) {
  commit();
  const step = steps.list[at];
  if (!step) return;
  steps.at = at;
  restore(JSON.parse(step.state));
  kept = step.kept;
  current.recording = step.recorded;
  recording.files = step.files;
  showSteps();
  const { door } = state;
  openDoor(door);
  store();
}

function restore(values) {
  for (const name of Object.keys(state)) state[name] = values[name] ?? state[name];
}

const withoutMotion = (variant) => ({ ...variant, body: null, answer: { ...variant.answer, motion: null } });

/** Store case and variants in this browser; without room for the answers, only the case. */
function store() {
  const own = current[state.door];
  const entry = { start: JSON.stringify(about.start), state, shown: own?.values ? withoutMotion(own) : null, kept: kept.map(withoutMotion) };
  for (const content of [entry, { ...entry, shown: null, kept: [] }]) {
    try {
      localStorage.setItem(STORE, JSON.stringify(content));
      return;
    } catch { /* The storage is full. */ }
  }
}

/** Restore what this browser has stored for the same start of the page; return whether there was something. */
function restoreStored() {
  let stored = null;
  try { stored = JSON.parse(localStorage.getItem(STORE)); } catch { /* Not written by this page. */ }
  if (stored?.start !== JSON.stringify(about.start) || !about.models.some(({ name }) => name === stored.state?.model)) return false;
  restore(stored.state);
  kept = stored.kept;
  return true;
}

async function copyLink() {
  if (hasInvalidField()) return;
  const variants = kept.filter(({ values }) => values).map(({ door, values, title }) => ({ door, values, title }));
  const content = { door: state.door, ball: caseValues("ball"), floor: caseValues("floor"), variants, units: units.get() };
  const address = `${location.origin}/#case=${encodeURIComponent(JSON.stringify(content))}`;
  const isCopied = await copyText(address, "Copy this link");
  if (isCopied) flash("link", "Link copied");
  const hasRecording = kept.some(({ values }) => !values) || state.door === "recording";
  showNote(`The link works in browsers that have opened the full address shown in the terminal, while the server runs. For others use “Save as HTML”.${hasRecording ? " It holds the models; recordings are too large for a link." : ""}`);
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

/** Take over the content of a link; return whether it is one of this page. */
async function takeLink(text) {
  let content = null;
  try { content = JSON.parse(text); } catch { return false; }
  const { door, ball, floor, variants, units: name } = content ?? {};
  if (!DOORS.includes(door) || ![ball, floor].every(isCase) || !Array.isArray(variants) || !variants.every((variant) => isCase(variant?.values))) return false;
  await setUnits(name);
  takeValues(floor);
  state.door = door;
  for (const variant of variants) {
    const answer = await runTask("Computing", "solve", JSON.stringify(variant.values), new AbortController()).catch(showError);
    if (answer) kept = [...kept, { door: variant.door, style: freeStyle(kept.filter((other) => (other.door === "floor") === (variant.door === "floor"))), values: variant.values, title: variant.title, answer }];
  }
  return true;
}

/** Take over the units of the fields, "SI" or empty; the server describes the fields in them. */
async function setUnits(name) {
  units.set(name === "SI" ? name : "");
  Object.assign(about, await requestAbout());
  nameUnits();
}

function nameUnits() {
  byId("units").textContent = units.get() ? "Fields in mm, MPa" : "Fields in SI units";
}

async function switchUnits() {
  try {
    await setUnits(units.get() ? "" : "SI");
    openDoor(state.door);
    // Warnings have the units of the fields; those of a recording are always SI units.
    if (state.door !== "recording") solve();
  } catch (error) { showError(error); }
}

function reset() {
  localStorage.removeItem(STORE);
  kept = [];
  recording.files = [];
  Object.assign(current, { recording: null, ball: null, floor: null });
  begin(about.start);
  commit();
}

/** Begin with the values of a case, or with the first preset. */
function begin(start) {
  Object.assign(state, { values: {}, unknowns: {}, moved: {}, recording: {}, model: about.presets[0].values.model.name });
  const floors = about.presets.find((preset) => preset.door === "floor");
  takeValues(floors.values);
  if (Object.keys(start).length) takeValues(start);
  openDoor(start.floor || start.room ? "floor" : "ball");
}

// ---- Actions.

/** Save the calibration report of a recording, as it was assessed. */
async function saveReport({ body }) {
  byId("report").disabled = true;
  try {
    saveFile("calibration.html", await runTask("Calibration report", "report", body, new AbortController(), { showNow: true }), "text/html");
  } catch (error) { showError(error); } finally { if (byId("report")) byId("report").disabled = false; }
}

async function fit() {
  byId("fit").disabled = true;
  try {
    showFit(await runTask("Fitting a ball to the recording", "fit", checkedBody(caseValues("ball")), new AbortController(), { showNow: true }));
  } catch (error) { showError(error); } finally { if (byId("fit")) byId("fit").disabled = false; }
}

/** Take over the values of a fit, and show its result beside them. */
function showFit({ values, text, details, name = "" }) {
  takeValues(values);
  fitted = { text, details, name, isNew: true, values: JSON.stringify(caseValues("ball")) };
  openDoor("ball");
}

/** Fit the ball to the curve of a press. */
async function onPress(body, name) {
  hideMessage();
  body.set("case", JSON.stringify(caseValues("ball")));
  try {
    const answer = await runTask(`Fitting the ball to ${name}`, "press", body, new AbortController());
    closePress();
    showFit(answer);
  } catch (error) { showError(error); }
}

/** Return the button that looks for a change with which a source conforms or a required level is met, if there is a need. */
function improveButton(own) {
  if (!own?.values || ["conforms", "level"].includes(own.answer.headline.result)) return [];
  const title = own.answer.room ? `Change that meets ${own.values.room.required} dB` : "Smallest change that conforms";
  return [button(title, () => improve(title), { id: "improve" })];
}

async function improve(title) {
  const asked = byId("improve");
  const { door } = state;
  asked.disabled = true;
  try {
    const { changes, none, note } = await runTask(title, "improve", JSON.stringify(caseValues(door)), new AbortController(), { showNow: true });
    if (!asked.isConnected) return;
    const apply = ({ key, value }) => {
      const [group, name] = key.split(".");
      const values = caseValues(door);
      (values[group] ??= {})[name] = value;
      takeValues(values);
      openDoor(door);
    };
    const list = changes.map((change) => element("li", {}, `${change.text} `, button("Apply", () => apply(change))));
    byId("result").replaceChildren(changes.length ? element("ul", {}, ...list) : element("p", {}, none), element("p", { class: "help" }, note));
    byId("result").scrollIntoView({ block: "nearest" });
  } catch (error) { showError(error); } finally { asked.disabled = false; }
}

/** Move to the field with an error, of which the message is shown; return whether there is one. */
function hasInvalidField() {
  const input = document.querySelector("#inputs [aria-invalid]");
  input?.focus();
  return Boolean(input);
}

/** Save the page of all variants; its plots show the values, not their differences. */
function savePage(variants) {
  showPlots(variants, { thirds: byId("thirds").checked });
  saveFile("thud.html", pageOf(variants, about.version), "text/html");
  showAll();
}

async function download(name, copyButton) {
  if (hasInvalidField()) return;
  const values = caseValues();
  if (name === "study.toml") values.moved = state.moved;
  try {
    const file = await fileOf(name, values);
    if (!copyButton) saveFile(name, file);
    else if (await copyText(await file.text(), copyButton.textContent)) flash(copyButton, "Copied");
    hideMessage();
  } catch (error) { showError(error); }
}

function listen() {
  byId("inputs").addEventListener("focusin", ({ target }) => target.closest(".field")?.scrollIntoView({ block: "nearest" }));
  byId("inputs").addEventListener("submit", (event) => event.preventDefault());
  for (const door of DOORS) byId(`door_${door}`).addEventListener("click", () => openDoor(door));
  byId("doors").addEventListener("keydown", (event) => {
    const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (move) openDoor(DOORS[(DOORS.indexOf(state.door) + move + 3) % 3], { focus: true });
  });
  byId("keep").addEventListener("click", keep);
  byId("undo").addEventListener("click", () => goTo(steps.at - 1));
  byId("redo").addEventListener("click", () => goTo(steps.at + 1));
  byId("units").addEventListener("click", switchUnits);
  byId("reset").addEventListener("click", reset);
  byId("link").addEventListener("click", copyLink);
  byId("save_page").addEventListener("click", () => { const variants = variantsOfDoor(); if (variants.length) savePage(variants); });
  for (const name of ["thirds", "differences"]) byId(name).addEventListener("change", showAll);
  for (const target of document.querySelectorAll("[data-file]")) target.addEventListener("click", () => download(target.dataset.file));
  for (const target of document.querySelectorAll("[data-copy]")) target.addEventListener("click", () => download(target.dataset.copy, target));
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") { hideTip(); for (const menu of document.querySelectorAll(".menu[open]")) { menu.open = false; menu.firstElementChild.focus(); } }
    const isTyping = event.target.matches?.("textarea, [type=text], [type=number]") && document.body.classList.contains("outdated");
    if (!(event.ctrlKey || event.metaKey) || isTyping) return;
    const isRedo = event.key === "y" || (event.key.toLowerCase() === "z" && event.shiftKey);
    if (event.key.toLowerCase() !== "z" && !isRedo) return;
    event.preventDefault();
    goTo(steps.at + (isRedo ? 1 : -1));
  });
  addEventListener("click", (event) => { for (const menu of document.querySelectorAll(".menu[open]")) if (!menu.contains(event.target) || event.target.closest("button")) menu.open = false; });
  addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dragging"); });
  addEventListener("dragleave", () => document.body.classList.remove("dragging"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dragging");
    if (!event.dataTransfer.files.length) return;
    const files = [...event.dataTransfer.files];
    if (state.door !== "recording") openDoor("recording");
    addFiles(files, onChange);
  });
  listenToBall();
}

/** Show nothing but the message until a token arrives, in this page or another one; then load the page with its link. */
function awaitToken() {
  document.body.classList.add("locked");
  retryTimer = setTimeout(() => ask("about").then(() => location.reload(), () => {}), RETRY_INTERVAL);
  addEventListener("storage", ({ key }) => { if (key === "token") location.reload(); });
  addEventListener("hashchange", () => {
    const token = new URLSearchParams(location.hash.slice(1)).get("token");
    if (!token) return;
    localStorage.setItem("token", token);
    history.replaceState(null, "", fragment.size ? `#${fragment}` : location.pathname);
    location.reload();
  });
}

async function main() {
  try {
    Object.assign(about, await firstAbout);
  } catch (error) {
    byId("verdict").replaceChildren();
    setOutdated(true, false);
    showMessage(error.message);
    if (error instanceof ConnectionError) awaitToken();
    return;
  }
  byId("tools").hidden = false;
  nameUnits();
  addPlotMenus();
  listen();
  const link = fragment.get("case");
  const door = DOORS.find((name) => fragment.has(name));
  if (firstVariant) current[firstVariant.door] = firstVariant;
  const isRestored = link === null && restoreStored();
  if (isRestored) openDoor(door ?? state.door);
  else begin(about.start);
  if (link !== null) {
    if (await takeLink(link)) openDoor(state.door);
    else showMessage("The link does not contain a case; allowed: links copied from this page");
  } else if (door && !isRestored) openDoor(door);
  commit();
}

main();
