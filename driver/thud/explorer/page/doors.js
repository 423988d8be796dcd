// The three doors: what each shows, its variants, and the actions on its answer.
import { byId, button, element, saveFile } from "thud/page.js";
import { setFragment } from "thud/request.js";
import { resultOf } from "thud/headline.js";
import { showAnswer, showFloors, showWarnings } from "thud/results.js";
import { showBall } from "thud/ball.js";
import { showRatings, showSection } from "thud/section.js";
import { caseValues, isTyping, state, takeValues } from "thud/form.js";
import { buildDoor, recording, recordingBody, showAsks } from "thud/recording.js";
import { freeStyle, nameVariants, showVariants } from "thud/variants.js";
import { CHANGE_NOTES, changeText, fitText, noChangeText, sentences } from "thud/texts.js";
import { showSounds } from "thud/listen.js";
import { PAUSE, cancel, computeSoon, current, hideMessage, isCurrent, kept, listenToAnswers, onInvalid, onTyping, once, requestOf, runTask, runningJob, showError, showMessage, showStatus, solve, subjectOf, titleOfDoor } from "thud/answers.js";
import { commit, commitSoon, takeStep } from "thud/steps.js";

const RECORDING_TEXT = "Choose the record of one drop or more. The answer is the verdict with its uncertainty, the levels within the limits of the standards, and a calibration report to save. Missing values can be stated afterwards: the page asks for those that matter.";
export const DOORS = ["recording", "ball", "floor"];
// Text on the last fit, and the values that it belongs to.
let fitted = { answer: null, values: "" };
// The variants on the page.
let shown = [];

// ---- Answers.

/** Change the page; a focus on what has gone moves to what replaces it, or to the headline. */
function changePage(change) {
  const old = document.activeElement;
  change();
  const now = document.activeElement;
  if (old === document.body || now !== document.body) return;
  const next = byId(old.id);
  (next && !next.disabled ? next : byId("verdict")).focus({ preventScroll: true });
}

/** Return the variants of the current door, its own first. */
function variantsOfDoor() {
  const { door } = state;
  const own = current[door];
  if (own) own.title = titleOfDoor(door);
  const others = kept.list.filter((variant) => (variant.door === "floor") === (door === "floor"));
  if (door === "ball" && current.recording && isCurrent("recording"))
    others.unshift({ ...current.recording, title: titleOfDoor("recording"), style: freeStyle(others) });
  return [own, ...others].filter(Boolean);
}

/** Show the answers of the current door. */
export function showAll() {
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
  byId("variants_section").hidden = variants.length < 2;
  byId("keep").hidden = isEmpty;
  byId("next").replaceChildren();
  byId("result").replaceChildren();
  byId("improvement").replaceChildren(...improveButton(own));
  showAsks(own && door === "recording" ? own.answer.asks : [], formHandlers);
  if (isEmpty) {
    showNothing(door);
    return;
  }
  shown = variants;
  nameVariants(variants);
  showAnswer(variants, view);
  showWarnings(own);
  showFloors(variants);
  showBall(own.answer.motion);
  showSection(own.answer);
  showRatings(variants);
  showVariants(variants, { remove: removeVariant, rename: renameVariant });
  showSounds(own.answer.room ? variants : [], showError);
  if (door === "recording") byId("next").append(...toAsks(own.answer.asks), button("Calibration report", saveReport, { class: "strong", id: "report" }), button("Fit a ball to this recording", fit, { id: "fit" }));
  if (door === "ball" && JSON.stringify(own.values) === fitted.values) showFitTexts();
  if (door === "ball") byId("next").append(button("Drop it on a floor", () => openDoor("floor", { focus: true })));
}

/** Return a button to what the answer asks for, which is further down on narrow screens. */
function toAsks(asks) {
  if (!asks.length) return [];
  return [button("State what is missing", () => byId("asks").querySelector("input").focus(), { class: "narrow strong" })];
}

/** Show the result of the last fit, and its details folded; at first in sight. */
function showFitTexts() {
  const { answer, isNew } = fitted;
  const notes = element("p", { class: "help" }, sentences(answer.notes));
  byId("result").append(element("p", {}, fitText(answer)), ...(answer.notes.length
    ? [element("details", {}, element("summary", {}, "How well it fits"), notes)] : []));
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
  const sections = document.querySelectorAll("#warnings_section, .figure, .card");
  for (const target of sections) target.hidden = true;
}

// ---- Variants.

/** Keep the variant of the form; while a slow case is computed, the one that is shown. */
export async function keep() {
  const job = runningJob();
  if (job && !job.slow) await job.end;
  const own = current[state.door];
  if (!own) return;
  kept.list = [...kept.list, { ...own, style: freeStyle(variantsOfDoor()) }];
  showAll();
  commit();
}

/** Remove a kept variant, or the recording with its files. */
function removeVariant(variant) {
  if (kept.list.includes(variant)) kept.list = kept.list.filter((other) => other !== variant);
  else {
    recording.files = [];
    current.recording = null;
  }
  showAll();
  byId("keep").focus();
  commit();
}

/** Name what a door shows. */
function setTitle(door, text) {
  state.titles = { ...state.titles, [door]: { text, subject: subjectOf(door) } };
}

/** Give a variant a name of the user; an empty one takes it back, and null changes nothing. */
function renameVariant(variant, text) {
  const at = shown.indexOf(variant);
  const title = text?.trim() || undefined;
  if (text !== null && title !== variant.label) {
    if (kept.list.includes(variant)) kept.list = kept.list.map((other) => (other === variant ? { ...variant, title } : other));
    else setTitle(variant.door, title);
  }
  showAll();
  document.querySelectorAll("#variants .name")[at]?.focus();
  commit();
}

// ---- Doors.

/** Open a door, and compute its case if that is not known. */
export function openDoor(door, { focus = false } = {}) {
  cancel();
  state.door = door;
  for (const name of DOORS) {
    const tab = byId(`door_${name}`);
    tab.setAttribute("aria-selected", String(name === door));
    tab.tabIndex = name === door ? 0 : -1;
    if (name === door && focus) tab.focus();
  }
  byId("panel").setAttribute("aria-labelledby", `door_${door}`);
  // Not the name alone, which an element has that the browser would then scroll to.
  setFragment(`door=${door}`);
  document.body.dataset.door = door;
  changePage(() => buildDoor(formHandlers));
  hideMessage();
  showAll();
  solve();
  commitSoon();
}

/** Go to another step; a text that is no value is taken back first. */
export function move(count) {
  if (isTyping() || takeStep(count)) openDoor(state.door);
}

/** Compute the case after a change of the form, and remember the change. */
function onChange() {
  commitSoon();
  computeSoon();
}

export const formHandlers = { onChange, onTyping, onInvalid, onPress };
listenToAnswers({
  onAnswer: () => { showAll(); commitSoon(); },
  onMissing: (name) => showAsks([{ values: { [name]: "" } }], formHandlers),
});

// ---- Actions.

/** Return the answer of a task that is shown at once. */
const runAction = (...task) => runTask(...task, new AbortController());

/** Save the calibration report of the recording. */
const saveReport = once(async () => {
  saveFile("calibration.html", await runAction("Calibration report", "report", recordingBody()), "text/html");
});

const fit = () => fitTo("Fitting a ball to the recording", "fit", () => recordingBody(caseValues("ball")));

/** Fit the ball to the curve of a press. */
function onPress(body, name) {
  hideMessage();
  body.set("case", JSON.stringify(caseValues("ball")));
  fitTo(`Fitting the ball to ${name}`, "press", () => body, name.replace(/\.\w+$/, ""));
}

/** Fit the ball, and take over its values unless others were entered in the meantime. */
const fitTo = once(async (title, path, newBody, name) => {
  const requests = () => JSON.stringify([requestOf("ball"), requestOf("recording"), isTyping()]);
  const before = requests();
  const answer = await runAction(title, path, newBody());
  if (requests() !== before) {
    showMessage("The fit was not taken over: values have changed since it began");
    return;
  }
  showFit(answer, name);
});

/** Take over the values of a fit, and show its result beside them. */
function showFit(answer, name) {
  takeValues(answer.values);
  if (name) setTitle("ball", name);
  fitted = { answer, isNew: true, values: JSON.stringify(caseValues("ball")) };
  openDoor("ball");
}

/** Return the button that looks for a change that conforms or meets a requirement, if needed. */
function improveButton(own) {
  if (!own?.values || ["conforms", "level"].includes(resultOf(own.answer))) return [];
  const title = own.answer.room ? `Change that meets ${own.values.room.required} dB` : "Smallest change that conforms";
  return [button(title, () => improve(title), { id: "improve" })];
}

const improve = once(async (title) => {
  const { door } = state;
  const request = requestOf(door);
  const values = JSON.stringify(caseValues(door));
  const answer = await runAction(title, "improve", values);
  await runningJob()?.end;
  if (state.door !== door || requestOf(door) !== request) return;
  const apply = ({ key, value }) => {
    const [group, name] = key.split(".");
    const values = caseValues(door);
    (values[group] ??= {})[name] = value;
    takeValues(values);
    openDoor(door);
  };
  const list = answer.changes.map((change) => element("li", {},
    `${changeText(change, JSON.parse(values))} `, button("Apply", () => apply(change))));
  byId("result").replaceChildren(
    list.length ? element("ul", {}, ...list) : element("p", {}, noChangeText(answer)),
    element("p", { class: "help" }, CHANGE_NOTES[door]));
  byId("result").scrollIntoView({ block: "nearest" });
});
