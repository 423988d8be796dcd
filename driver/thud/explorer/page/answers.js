// Requests and answers of the doors, messages, and the tasks of the server.
import { byId, button, element } from "thud/page.js";
import { ConnectionError, ServerError, ask, follow } from "thud/request.js";
import { about, caseValues, isTyping, markField, state } from "thud/form.js";
import { isLaboratory, recording, recordingBody, statedTable } from "thud/recording.js";

// Pause before a slow case is requested, and before outdated results are dimmed, ms.
export const PAUSE = 120;
// Time after which a task is slow, ms.
const SLOW = 250;
// Time between attempts to reach the server, ms.
export const RETRY_INTERVAL = 1500;
/** The current variant of each door, and those that were kept. */
export const current = { recording: null, ball: null, floor: null };
export const kept = { list: [] };
let job = null;
let timer = 0;
let dimTimer = 0;
let retryTimer = 0;
// Whether the message is about the present values.
let hasError = false;
// What is called after each answer, and with the name of a missing field of the recording.
let listeners = {};

export function listenToAnswers(newListeners) {
  listeners = newListeners;
}

// ---- Requests: an answer is current if it is that to the present values and files.

const fileIds = new WeakMap();
let fileCount = 0;

/** Return the number of a file, which no other one has. */
function idOf(file) {
  if (!fileIds.has(file)) fileIds.set(file, (fileCount += 1));
  return fileIds.get(file);
}

/** Return what a name of the user belongs to: the files of a recording, or the values of a case. */
export const subjectOf = (door) => JSON.stringify(door === "recording" ? recording.files.map(idOf) : caseValues(door));

/** Return the text of the request of a door with its present values and files. */
export const requestOf = (door) => JSON.stringify([subjectOf(door), door === "recording" && statedTable()]);

/** Return whether the answer of a door is that to its present values and files. */
export function isCurrent(door) {
  if (door === "recording" && !recording.files.length) return !current.recording;
  return current[door]?.request === requestOf(door);
}

/** Return the name that the user has given to what a door shows. */
export const titleOfDoor = (door) => (state.titles[door]?.subject === subjectOf(door) ? state.titles[door].text : undefined);

/** Dim results of other values, after a delay in ms, and disable what would save them. */
export function showStatus(delay = 0) {
  clearTimeout(dimTimer);
  const isOutdated = isTyping() || !isCurrent(state.door);
  byId("panel").setAttribute("aria-busy", String(Boolean(job || timer)));
  const show = () => {
    document.body.classList.toggle("outdated", isOutdated);
    for (const target of document.querySelectorAll("#report, .figure .tools button")) target.disabled = isOutdated;
  };
  if (isOutdated && delay) dimTimer = setTimeout(show, delay);
  else show();
}

let released = Promise.resolve();

/** Let changes of the page wait for the end of a click, which would miss a button that moves. */
export function holdForClicks() {
  addEventListener("pointerdown", (event) => {
    if (!event.target.closest?.("button, summary, label")) return;
    released = new Promise((resolve) => {
      for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => setTimeout(resolve), { once: true });
    });
  }, true);
}

// ---- Messages.

export function showMessage(message) {
  byId("message").textContent = message;
  byId("message").hidden = false;
}

export function hideMessage() {
  byId("message").hidden = true;
  hasError = false;
  markField(null);
}

/** Show that a field is being typed. */
export function onTyping() {
  if (!isTyping() && isCurrent(state.door)) hideMessage();
  showStatus();
}

/** Show that a field has no valid value. */
export function onInvalid(name, message) {
  hideMessage();
  markField(name, message);
  showMessage(message);
  hasError = true;
  showStatus();
}

/** Show an error; if the server cannot be reached, try again later. */
export function showError(error) {
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
export function reconnect() {
  clearTimeout(retryTimer);
  ask("about").then(() => { hideMessage(); solve(); }, showError);
}

/** Return a function that shows the error of an action, and does nothing while that still runs. */
export function once(action) {
  let isRunning = false;
  return async (...values) => {
    if (isRunning) return;
    isRunning = true;
    try { await action(...values); } catch (error) { showError(error); } finally { isRunning = false; }
  };
}

// ---- Tasks of the server.

/** Return the answer of a task; if it is slow, show that it runs, and a button to cancel it. */
export async function runTask(name, path, body, controller, onSlow = () => {}) {
  const line = element("div", { class: "task" }, element("span", {}, name),
    element("progress", { "aria-label": name }), button("Cancel", () => controller.abort()));
  const slow = setTimeout(() => { byId("tasks").append(line); onSlow(); }, SLOW);
  try {
    return await follow(path, body, controller.signal);
  } finally {
    clearTimeout(slow);
    line.remove();
  }
}

/** Compute the case or assess the recording, if its answer is not known. */
export async function solve() {
  clearTimeout(timer);
  timer = 0;
  if (job && !job.slow) { job.repeat = true; return; }
  job?.controller.abort();
  job = null;
  const { door } = state;
  if (door === "recording" && !recording.files.length) { current.recording = null; listeners.onAnswer(); }
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
    listeners.onAnswer();
    // Time from the request to the next frame, for tests and benchmarks.
    requestAnimationFrame(() => { document.body.dataset.latency = String(performance.now() - thisJob.start); });
  } catch (error) {
    // What is wrong with a text that is typed stays until it is a value.
    if (job === thisJob && !thisJob.repeat && !isTyping()) {
      showError(error);
      hasError = true;
      const isField = about.recording.some(({ name }) => name === error.field);
      if (isField && !state.recording[error.field]) listeners.onMissing(error.field);
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
  const onSlow = () => {
    thisJob.slow = true;
    if (thisJob.repeat) thisJob.controller.abort();
    showStatus();
  };
  const body = JSON.stringify(values);
  const answer = await runTask("Computing", "solve", body, thisJob.controller, onSlow);
  return { values, chosen, answer };
}

async function assess(thisJob) {
  const [{ name }, ...others] = recording.files.filter((file) => !isLaboratory(file));
  const title = `Assessing ${recording.files.map((file) => file.name).join(", ")}`;
  const answer = await runTask(title, "measure", recordingBody(), thisJob.controller);
  const drops = `${answer.drops} drop${answer.drops === 1 ? "" : "s"}`;
  const asks = answer.asks.filter((ask) => Object.keys(ask.values).some((key) => !(key in state.recording)));
  return { name: `${others.length ? `${name} and ${others.length} more` : name}, ${drops}`, answer: { ...answer, asks } };
}

/** Cancel the computation that runs, and the one that waits. */
export function cancel() {
  job?.controller.abort();
  job = null;
  clearTimeout(timer);
  timer = 0;
}

/** Return the computation that runs, or null; its `end` is a promise. */
export const runningJob = () => job;

/** Compute the case after a change of the form; a slow case only after a pause. */
export function computeSoon() {
  released.then(() => { if (!isTyping()) hideMessage(); });
  if (job?.request === requestOf(state.door) && !job.repeat) { showStatus(PAUSE); return; }
  const isSlow = (job ?? current[state.door])?.slow || state.door === "recording";
  if (!isSlow) { solve(); return; }
  cancel();
  timer = setTimeout(solve, PAUSE);
  released.then(() => showStatus());
}
