// Main module of the page: sends the values of the form to the server and shows the latest answer.
import { byId, button, element, saveFile } from "./page.js";
import { ConnectionError, ServerError, ask, firstAbout, follow, fragment, requestAbout, setFragment, takeFragment, units } from "./request.js";
import { hideTip, showCriteria, showFloors, showForces, showHeadline, showRooms, showWarnings } from "./results.js";
import { firstVariant } from "./first.js";
import { storeCase, storedCase } from "./storage.js";
import { listenToBall, showBall } from "./ball.js";
import { about, caseValues, isCase, isTyping, markField, state, takeValues } from "./form.js";
import { closePress } from "./press.js";
import { addFiles, buildDoor, isLaboratory, keepStated, recording, recordingBody, recordingRequest, showAsks, statedRows } from "./recording.js";
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
let fitted = { text: "", details: "", values: "" };
let job = null;
let timer = 0;
let dimTimer = 0;
// Whether the message is about the present values, and the variants on the page.
let hasError = false;
let shown = [];
let retryTimer = 0;

// ---- Requests: an answer is current as long as it answers the request of the present values and files.

const fileIds = new WeakMap();
let fileCount = 0;

/** Return the number of a file, which no other one has. */
function idOf(file) {
  if (!fileIds.has(file)) fileIds.set(file, (fileCount += 1));
  return fileIds.get(file);
}

/** Return what a name of the user belongs to: the files of a recording, or the values of a case. */
const subjectOf = (door) => JSON.stringify(door === "recording" ? recording.files.map(idOf) : caseValues(door));

/** Return the text of the request of a door with its present values and files. */
const requestOf = (door) => JSON.stringify([subjectOf(door), door === "recording" ? recordingRequest().values : units.get()]);

/** Return whether the answer of a door, if it needs one, is that to its present values and files. */
function isCurrent(door) {
  if (door === "recording" && !recording.files.length) return !current.recording;
  return current[door]?.request === requestOf(door);
}

/** Return the name that the user has given to what a door shows. */
const titleOfDoor = (door) => (state.titles[door]?.subject === subjectOf(door) ? state.titles[door].text : undefined);

/** Dim results that are not those of the present values, after a delay in ms, and disable what would save them. */
function showStatus(delay = 0) {
  clearTimeout(dimTimer);
  const isOutdated = isTyping() || !isCurrent(state.door);
  byId("panel").setAttribute("aria-busy", String(Boolean(job || timer)));
  const show = () => {
    document.body.classList.toggle("outdated", isOutdated);
    for (const target of [byId("report"), byId("save_page"), ...document.querySelectorAll(".figure .menu button")]) if (target) target.disabled = isOutdated;
  };
  if (isOutdated && delay) dimTimer = setTimeout(show, delay);
  else show();
}

let released = Promise.resolve();

/** Let changes of the page wait for the end of a click, which would otherwise miss a button that moves. */
function holdForClicks() {
  addEventListener("pointerdown", (event) => {
    if (!event.target.closest?.("button, summary, label")) return;
    released = new Promise((resolve) => {
      for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => setTimeout(resolve), { once: true });
    });
  }, true);
}

/** Change the page; a focus on what has gone moves to what replaces it, or to the headline. */
function changePage(change) {
  const old = document.activeElement;
  change();
  const now = document.activeElement;
  if (old === document.body || (old.isConnected && now === old) || (now && now !== document.body)) return;
  const next = byId(old.id);
  (next && !next.disabled ? next : byId("verdict")).focus({ preventScroll: true });
}

// ---- Messages.

function showMessage(message) {
  byId("message").textContent = message;
  byId("message").hidden = false;
}

function hideMessage() {
  byId("message").hidden = true;
  hasError = false;
  markField(null);
}

/** Show that a field is being typed. */
function onTyping() {
  if (!isTyping() && isCurrent(state.door)) hideMessage();
  showStatus();
}

/** Show that a field has no valid value. */
function onInvalid(name, message) {
  hideMessage();
  markField(name, message);
  showMessage(message);
  hasError = true;
  showStatus();
}

/** Show an error; if the server cannot be reached, try again later. */
function showError(error) {
  if (error.name === "AbortError") return;
  if (!(error instanceof ConnectionError || error instanceof ServerError)) throw error;
  showMessage(error.message);
  markField(error.field, error.message);
  if (error instanceof ConnectionError) {
    clearTimeout(retryTimer);
    retryTimer = setTimeout(reconnect, RETRY_INTERVAL);
  }
  showStatus();
}

/** Go on if the server answers, or try again later. */
function reconnect() {
  clearTimeout(retryTimer);
  ask("about").then(() => { hideMessage(); solve(); }, showError);
}

/** Return a function that shows the error of an action, and does nothing while that still runs. */
function once(action) {
  let isRunning = false;
  return async (...values) => {
    if (isRunning) return;
    isRunning = true;
    try { await action(...values); } catch (error) { showError(error); } finally { isRunning = false; }
  };
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

/** Compute the case or assess the recording, unless that is known, after cancelling a slow computation or waiting for a quick one. */
async function solve() {
  clearTimeout(timer);
  timer = 0;
  if (job && !job.slow) { job.repeat = true; return; }
  job?.controller.abort();
  job = null;
  const { door } = state;
  if (door === "recording" && !recording.files.length) { current.recording = null; showAll(); }
  if (isCurrent(door) && !current[door]?.isPartial) {
    if (hasError && !isTyping()) hideMessage();
    showStatus();
    return;
  }
  const thisJob = { controller: new AbortController(), slow: door === "recording", repeat: false, start: performance.now(), request: requestOf(door) };
  job = thisJob;
  thisJob.end = new Promise((resolve) => { thisJob.resolve = resolve; });
  // A quick answer comes before the eye would see the change.
  showStatus(PAUSE);
  try {
    const variant = await (door === "recording" ? assess(thisJob) : compute(thisJob, door));
    await released;
    current[door] = { door, style: 0, request: thisJob.request, slow: thisJob.slow, ...variant };
    if (state.door !== door || job !== thisJob) return;
    if (hasError && !isTyping()) hideMessage();
    showAll();
    commitSoon();
    // Time from the request to the next frame, for tests and benchmarks.
    requestAnimationFrame(() => { document.body.dataset.latency = String(performance.now() - thisJob.start); });
  } catch (error) {
    if (job === thisJob && !thisJob.repeat) {
      showError(error);
      hasError = true;
      const isMissing = door === "recording" && !state.recording[error.field] && about.recording.some((field) => field.name === error.field);
      if (isMissing) showAsks([{ reason: "", values: { [error.field]: "" } }], { onChange, onTyping });
    }
  } finally {
    if (job === thisJob) {
      job = null;
      if (thisJob.repeat) solve();
      showStatus(PAUSE);
    }
    thisJob.resolve();
  }
}

async function compute(thisJob, door) {
  const [values, { chosen }] = [caseValues(door), state];
  const answer = await runTask("Computing", "solve", JSON.stringify(values), thisJob.controller, { onReport: () => { thisJob.slow = true; showStatus(); } });
  return { values, chosen, answer };
}

async function assess(thisJob) {
  const [{ name }, ...others] = recording.files.filter((file) => !isLaboratory(file));
  const stated = statedRows();
  const { values } = recordingRequest();
  const title = `Assessing ${recording.files.map((file) => file.name).join(", ")}`;
  const answer = await runTask(title, "measure", recordingBody(), thisJob.controller, { showNow: true });
  const drops = `${answer.drops} drop${answer.drops === 1 ? "" : "s"}`;
  const asks = answer.asks.filter((ask) => Object.keys(ask.values).some((key) => !(key in values)));
  return { name: `${others.length ? `${name} and ${others.length} more` : name}, ${drops}`, stated, answer: { ...answer, asks } };
}

/** Compute the case after a change of the form; a slow case only after a pause. */
function onChange() {
  commitSoon();
  released.then(() => { if (!isTyping()) hideMessage(); });
  if (job?.request === requestOf(state.door) && !job.repeat) { showStatus(PAUSE); return; }
  const isSlow = (job ?? current[state.door])?.slow || state.door === "recording";
  if (!isSlow) { solve(); return; }
  job?.controller.abort();
  job = null;
  clearTimeout(timer);
  timer = setTimeout(solve, PAUSE);
  released.then(() => showStatus());
}

// ---- Results.

/** Return the variants of the current door, its own first. */
function variantsOfDoor() {
  const { door } = state;
  const own = current[door];
  if (own) own.title = titleOfDoor(door);
  if (door === "floor") return [own, ...kept.filter((variant) => variant.door === "floor")].filter(Boolean);
  const others = kept.filter((variant) => variant.door !== "floor");
  if (door === "ball" && current.recording && isCurrent("recording")) others.unshift({ ...current.recording, title: titleOfDoor("recording"), style: freeStyle(others) });
  return [own, ...others].filter(Boolean);
}

/** Show the answers of the current door. */
function showAll() {
  changePage(showAnswers);
  showStatus(PAUSE);
}

function showAnswers() {
  const { door, view } = state;
  const variants = variantsOfDoor();
  const own = current[door];
  const isEmpty = !own;
  document.body.dataset.door = door;
  document.body.classList.toggle("measured", Boolean(current.recording));
  for (const name of Object.keys(view)) byId(name).checked = view[name];
  hideTip();
  byId("variants_section").hidden = variants.length < 2;
  byId("keep").hidden = isEmpty;
  byId("next").replaceChildren();
  byId("result").replaceChildren();
  byId("improvement").replaceChildren(...improveButton(own));
  showAsks(own && door === "recording" ? own.answer.asks : [], { onChange, onTyping });
  if (isEmpty) {
    showNothing(door);
    return;
  }
  shown = variants;
  nameVariants(variants);
  showHeadline(own);
  showWarnings(own);
  const hasRoom = Boolean(own.answer.room);
  byId("levels_figure").hidden = hasRoom;
  byId("force_figure").hidden = hasRoom;
  byId("force_figure").classList.toggle("second", !hasRoom);
  byId("criteria_section").hidden = door === "floor";
  showPlots(variants, view);
  showFloors(variants);
  if (door !== "floor") showCriteria(variants);
  showBall(door === "recording" ? null : own.answer.motion);
  showVariants(variants, { remove: removeVariant, rename: renameVariant });
  showSounds(hasRoom ? variants : [], showError);
  if (door === "recording") byId("next").append(button("Calibration report", saveReport, { class: "strong", id: "report" }), button("Fit a ball to this recording", fit, { id: "fit" }));
  if (door === "ball" && JSON.stringify(own.values) === fitted.values) showFitTexts();
  if (door === "ball") byId("next").append(button("Drop it on a floor", () => openDoor("floor", { focus: true })));
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

/** Keep the variant that the form describes; while a slow case is computed, the one that is shown. */
async function keep() {
  if (job && !job.slow) await job.end;
  const own = current[state.door];
  if (!own) return;
  kept = [...kept, { ...own, style: freeStyle(variantsOfDoor()) }];
  showAll();
  commit();
}

/** Remove a kept variant, or the recording with its files. */
function removeVariant(variant) {
  if (kept.includes(variant)) kept = kept.filter((other) => other !== variant);
  else {
    recording.files = [];
    current.recording = null;
    keepStated();
  }
  showAll();
  byId("keep").focus();
  commit();
}

/** Give a variant a name of the user; an empty one takes it back, and null changes nothing. The focus returns to the name unless it has left. */
function renameVariant(variant, text, isLeft) {
  const at = shown.indexOf(variant);
  const title = text || undefined;
  if (text !== null && text !== variant.label) {
    if (kept.includes(variant)) kept = kept.map((other) => (other === variant ? { ...variant, title } : other));
    else state.titles = { ...state.titles, [variant.door]: { text: title, subject: subjectOf(variant.door) } };
  }
  showAll();
  if (!isLeft) document.querySelectorAll("#variants .name")[at]?.focus();
  commit();
}

// ---- Doors, history, storage and link.

/** Open a door, and compute its case if that is not known. */
function openDoor(door, { focus = false } = {}) {
  job?.controller.abort();
  job = null;
  clearTimeout(timer);
  timer = 0;
  state.door = door;
  for (const name of DOORS) {
    const tab = byId(`door_${name}`);
    tab.setAttribute("aria-selected", String(name === door));
    tab.tabIndex = name === door ? 0 : -1;
    if (name === door && focus) tab.focus();
  }
  byId("panel").setAttribute("aria-labelledby", `door_${door}`);
  setFragment(door);
  document.body.dataset.door = door;
  changePage(() => buildDoor({ onChange, onTyping, onInvalid, onPress }));
  hideMessage();
  showAll();
  solve();
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
  if (isEqual) { last.recorded = current.recording; return; }
  steps.list.splice(steps.at + 1, Infinity, next);
  steps.at = steps.list.length - 1;
  showSteps();
}

function sameCase(one, other) {
  const text = (entry) => JSON.stringify({ ...JSON.parse(entry), moved: null, door: null, earlier: null, view: null });
  return text(one) === text(other);
}

function showSteps() {
  const isFocused = [byId("undo"), byId("redo")].includes(document.activeElement);
  byId("undo").disabled = steps.at <= 0;
  byId("redo").disabled = steps.at >= steps.list.length - 1;
  // A button that is disabled loses the focus.
  if (isFocused) [document.activeElement, byId("undo"), byId("redo")].find((target) => target?.matches("button:enabled"))?.focus();
}

/** Go to another step; a text that is no value is taken back first. */
function move(count) {
  if (isTyping()) { openDoor(state.door); return; }
  commit();
  const step = steps.list[steps.at + count];
  if (!step) return;
  steps.at += count;
  restore({ ...JSON.parse(step.state), view: state.view });
  kept = step.kept;
  current.recording = step.recorded;
  recording.files = step.files;
  openDoor(state.door);
  showSteps();
  store();
}

function restore(values) {
  for (const name of Object.keys(state)) state[name] = values[name] ?? state[name];
}

const withoutMotion = (variant) => ({ ...variant, answer: { ...variant.answer, motion: null } });

/** Store case and variants in this browser; without room for the answers, only the case. */
function store() {
  const own = current[state.door];
  const entry = { start: JSON.stringify(about.start), state, shown: own?.values && isCurrent(state.door) ? withoutMotion(own) : null, kept: kept.map(withoutMotion) };
  storeCase(entry, { ...entry, shown: null, kept: [] });
}

/** Restore what this browser has stored for the same start of the page; return whether there was something. */
function restoreStored() {
  const entry = storedCase();
  if (entry?.start !== JSON.stringify(about.start) || !about.models.some(({ name }) => name === entry.state?.model)) return false;
  restore(entry.state);
  kept = entry.kept;
  // The files are not stored.
  keepStated();
  return true;
}

async function copyLink() {
  if (hasInvalidField()) return;
  const variants = kept.filter(({ values }) => values).map(({ door, values, title, chosen }) => ({ door, values, title, chosen }));
  const content = { door: state.door, ball: caseValues("ball"), floor: caseValues("floor"), variants, units: units.get(), view: state.view };
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

/** Take over the content of a link, as a step that can be undone; show a message if it is not one of this page. */
const takeLink = once(async (text) => {
  let content = null;
  try { content = JSON.parse(text); } catch { /* Not a link of this page. */ }
  const { door, ball, floor, variants, units: name, view } = content ?? {};
  const isVariant = (variant) => ["ball", "floor"].includes(variant?.door) && isCase(variant.values) && [variant.title, variant.chosen].every((text) => ["string", "undefined"].includes(typeof text));
  if (!DOORS.includes(door) || ![ball, floor].every(isCase) || !Array.isArray(variants) || !variants.every(isVariant)) {
    showMessage("The link does not contain a case; allowed: links copied from this page");
    return;
  }
  commit();
  await setUnits(name);
  const taken = [];
  for (const variant of variants) {
    const answer = await runTask("Computing", "solve", JSON.stringify(variant.values), new AbortController());
    taken.push({ ...variant, style: freeStyle(taken.filter((other) => (other.door === "floor") === (variant.door === "floor"))), answer });
  }
  takeValues(floor);
  state.door = door;
  for (const option of Object.keys(state.view)) state.view[option] = view?.[option] === true;
  kept = taken;
  openDoor(door);
  commit();
});

/** Take over an address that was entered into this page: its token, case or door. */
async function onAddress() {
  const parameters = takeFragment();
  hideMessage();
  const door = DOORS.find((name) => parameters.has(name));
  if (parameters.has("case")) await takeLink(parameters.get("case"));
  else if (door) openDoor(door);
  else reconnect();
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
  } catch (error) { showError(error); }
}

function reset() {
  commit();
  kept = [];
  recording.files = [];
  Object.assign(current, { recording: null, ball: null, floor: null });
  begin(about.start);
  commit();
}

/** Begin with the values of a case, or with the first preset. */
function begin(start) {
  Object.assign(state, { values: {}, unknowns: {}, moved: {}, recording: {}, earlier: [], titles: {}, model: about.presets[0].values.model.name });
  const floors = about.presets.find((preset) => preset.door === "floor");
  takeValues(floors.values);
  if (Object.keys(start).length) takeValues(start);
  openDoor(start.floor || start.room ? "floor" : "ball");
}

// ---- Actions.

/** Save the calibration report of the recording. */
const saveReport = once(async () => {
  saveFile("calibration.html", await runTask("Calibration report", "report", recordingBody(), new AbortController(), { showNow: true }), "text/html");
});

const fit = () => fitTo("Fitting a ball to the recording", "fit", () => recordingBody(caseValues("ball")));

/** Fit the ball to the curve of a press. */
function onPress(body, name) {
  hideMessage();
  body.set("case", JSON.stringify(caseValues("ball")));
  fitTo(`Fitting the ball to ${name}`, "press", () => body);
}

/** Fit the ball, and take over its values unless others were entered in the meantime. */
const fitTo = once(async (title, path, newBody) => {
  const requests = () => JSON.stringify([requestOf("ball"), requestOf("recording"), isTyping()]);
  const before = requests();
  const answer = await runTask(title, path, newBody(), new AbortController(), { showNow: true });
  if (requests() !== before) {
    showMessage("The fit was not taken over: values have changed since it began");
    return;
  }
  closePress();
  showFit(answer);
});

/** Take over the values of a fit, and show its result beside them. */
function showFit({ values, text, details, name }) {
  takeValues(values);
  if (name) state.titles = { ...state.titles, ball: { text: name, subject: subjectOf("ball") } };
  fitted = { text, details, isNew: true, values: JSON.stringify(caseValues("ball")) };
  openDoor("ball");
}

/** Return the button that looks for a change with which a source conforms or a required level is met, if there is a need. */
function improveButton(own) {
  if (!own?.values || ["conforms", "level"].includes(own.answer.headline.result)) return [];
  const title = own.answer.room ? `Change that meets ${own.values.room.required} dB` : "Smallest change that conforms";
  return [button(title, () => improve(title), { id: "improve" })];
}

const improve = once(async (title) => {
  const { door } = state;
  const request = requestOf(door);
  const { changes, none, note } = await runTask(title, "improve", JSON.stringify(caseValues(door)), new AbortController(), { showNow: true });
  await job?.end;
  if (state.door !== door || requestOf(door) !== request) return;
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
});

/** Move to the field with an error, of which the message is shown; return whether there is one. */
function hasInvalidField() {
  const input = document.querySelector("#inputs [aria-invalid]");
  input?.focus();
  return Boolean(input);
}

/** Save the page of all variants; its plots show the values, not their differences. */
function savePage(variants) {
  showPlots(variants, { thirds: state.view.thirds });
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
    const at = DOORS.indexOf(state.door);
    const next = { ArrowRight: (at + 1) % 3, ArrowLeft: (at + 2) % 3, Home: 0, End: 2 }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    openDoor(DOORS[next], { focus: true });
  });
  byId("keep").addEventListener("click", keep);
  byId("undo").addEventListener("click", () => move(-1));
  byId("redo").addEventListener("click", () => move(1));
  byId("units").addEventListener("click", switchUnits);
  byId("reset").addEventListener("click", reset);
  byId("link").addEventListener("click", copyLink);
  byId("save_page").addEventListener("click", () => { const variants = variantsOfDoor(); if (variants.length) savePage(variants); });
  for (const name of Object.keys(state.view)) byId(name).addEventListener("change", () => { state.view[name] = byId(name).checked; showAll(); });
  for (const target of document.querySelectorAll("[data-file]")) target.addEventListener("click", () => download(target.dataset.file));
  for (const target of document.querySelectorAll("[data-copy]")) target.addEventListener("click", () => download(target.dataset.copy, target));
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") { hideTip(); for (const menu of document.querySelectorAll(".menu[open]")) { menu.open = false; menu.firstElementChild.focus(); } }
    // A field for text has steps of its own.
    if (!(event.ctrlKey || event.metaKey) || event.target.matches?.("input[type=text], textarea, [contenteditable]")) return;
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
    const parameters = takeFragment();
    setFragment(String(parameters.size ? parameters : fragment));
    location.reload();
  });
}

async function main() {
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
  nameUnits();
  addPlotMenus();
  listen();
  holdForClicks();
  const link = fragment.get("case");
  const door = DOORS.find((name) => fragment.has(name));
  if (firstVariant) current[firstVariant.door] = firstVariant;
  const isRestored = restoreStored();
  if (isRestored) openDoor(door ?? state.door);
  else begin(about.start);
  commit();
  addEventListener("hashchange", onAddress);
  if (link !== null) await takeLink(link);
  else if (door && !isRestored) openDoor(door);
  commit();
}

main();
