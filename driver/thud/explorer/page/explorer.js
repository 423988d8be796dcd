// Main module of the page: sends the values of the form to the server and shows the latest answer.
import { addRoom, build, buildRecording, caseValues, describeChanges, fillConstruction, isCase, markField, startWith, state, titleOf } from "./form.js";
import { byId, element } from "./page.js";
import { listenToBall } from "./ball.js";
import { showSounds } from "./listen.js";
import { ConnectionError, ServerError, ask, follow, linkedCase, storeToken } from "./request.js";
import { show } from "./results.js";

// Pause after a change before a slow case is requested, ms.
const PAUSE = 120;
// Time between attempts to reach the server, ms.
const RETRY_INTERVAL = 1500;
const pinned = [];
let about = null;
let current = null;
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
  document.body.classList.remove("outdated");
  markField(null);
}

/** Show an error; if the server cannot be reached, try again later. */
function showError(error) {
  if (error.name === "AbortError") return;
  if (!(error instanceof ConnectionError || error instanceof ServerError)) throw error;
  showMessage(error.message);
  markField(error.message);
  if (error instanceof ConnectionError) {
    clearTimeout(retryTimer);
    retryTimer = setTimeout(() => ask("about").then(() => { hideMessage(); solve(); }, showError), RETRY_INTERVAL);
  }
}

// ---- Tasks of the server.

/** Return the answer of a task; show its progress and a button to cancel it, by default from its first report. */
async function runTask(name, path, body, controller, { showNow = false, onReport = () => {} } = {}) {
  const bar = element("progress", { max: 1, "aria-label": name });
  const button = element("button", { type: "button" }, "Cancel");
  button.addEventListener("click", () => controller.abort());
  const line = element("div", { class: "task" }, element("span", {}, name), bar, button);
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

/** Compute the case of the form, after cancelling a slow computation or waiting for a quick one. */
async function solve() {
  clearTimeout(timer);
  if (job && !job.slow) { job.repeat = true; return; }
  job?.controller.abort();
  const thisJob = { controller: new AbortController(), slow: false, repeat: false, start: performance.now() };
  job = thisJob;
  try {
    const values = caseValues();
    const answer = await runTask("Computing", "solve", JSON.stringify(values), thisJob.controller, { onReport: () => { thisJob.slow = true; } });
    hideMessage();
    current = { name: titleOf("model", state.model), short: titleOf("model", state.model), description: describeChanges(), values, answer, slow: thisJob.slow };
    refresh();
    // Time from the request to the next frame, for tests and benchmarks.
    requestAnimationFrame(() => { document.body.dataset.latency = String(performance.now() - thisJob.start); });
  } catch (error) {
    if (error.name !== "AbortError") document.body.classList.add("outdated");
    showError(error);
  } finally {
    if (job === thisJob) {
      job = null;
      if (thisJob.repeat) solve();
    }
  }
}

/** Compute the case after a change of the form; a slow case only after a pause. */
function onChange() {
  if (!(job ?? current)?.slow) return solve();
  job?.controller.abort();
  clearTimeout(timer);
  timer = setTimeout(solve, PAUSE);
}

/** Return a name that no variant has, with a number if needed. */
function newName(name) {
  const isUsed = (text) => pinned.some((variant) => variant.name === text);
  let [text, number] = [name, 1];
  while (isUsed(text)) text = `${name} (${number += 1})`;
  return text;
}

async function measure(file) {
  if (file.size > about.max_recording) return showMessage(`${file.name} is larger than ${about.max_recording / 1e6} MB; allowed: less`);
  const query = new URLSearchParams({ name: file.name });
  for (const field of document.querySelectorAll("[id^=recording_]")) {
    if (field.value) query.set(field.id.slice("recording_".length), field.value);
  }
  try {
    const answer = await runTask(`Measuring ${file.name}`, `measure?${query}`, file, new AbortController(), { showNow: true });
    hideMessage();
    const name = newName(`${file.name}, ${answer.drops} drop${answer.drops === 1 ? "" : "s"}`);
    pinned.push({ name, short: name, description: answer.verdict, answer, pinned: true });
    refresh();
  } catch (error) { showError(error); }
}

async function download(name) {
  const values = caseValues();
  if (name === "study.toml") values.moved = state.moved;
  try {
    const response = await ask(`download/${name}`, { method: "POST", body: JSON.stringify(values) });
    const link = element("a", { href: URL.createObjectURL(await response.blob()), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    hideMessage();
  } catch (error) { showError(error); }
}

function refresh() {
  const variants = current ? [current, ...pinned] : pinned;
  show(variants, (variant) => { pinned.splice(pinned.indexOf(variant), 1); refresh(); });
  showSounds(variants, showError);
}

// ---- Events.

function pin() {
  if (!current) return;
  const letter = String.fromCharCode(65 + (pinned.filter((variant) => variant.letter).length % 26));
  pinned.push({ ...current, name: `${letter}: ${current.name}`, short: `${letter}: ${current.name}`, letter, pinned: true });
  refresh();
}

async function copyLink() {
  const address = `${location.origin}/#case=${encodeURIComponent(JSON.stringify(caseValues()))}`;
  history.replaceState(null, "", address);
  const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
  byId("link").textContent = copied ? "Link copied" : "Link is in the address bar";
  setTimeout(() => { byId("link").textContent = "Copy link"; }, 2000);
}

function listen() {
  byId("form").addEventListener("submit", (event) => event.preventDefault());
  const rebuild = () => {
    // Losing the focus enters the text being typed, before the field is replaced.
    if (byId("form").contains(document.activeElement) && document.activeElement.matches("input")) document.activeElement.blur();
    build(onChange);
    onChange();
  };
  byId("model").addEventListener("change", (event) => { state.model = event.target.value; rebuild(); });
  byId("floor").addEventListener("change", (event) => {
    state.floor = event.target.value;
    state.room &&= Boolean(state.floor);
    rebuild();
  });
  byId("construction").addEventListener("change", (event) => { fillConstruction(event.target.value); rebuild(); });
  byId("has_room").addEventListener("change", (event) => {
    if (event.target.checked) addRoom();
    else state.room = false;
    rebuild();
  });
  byId("pin").addEventListener("click", pin);
  byId("reset").addEventListener("click", () => { pinned.length = 0; startWith(about.start, onChange); onChange(); });
  byId("link").addEventListener("click", copyLink);
  for (const button of document.querySelectorAll("[data-file]")) button.addEventListener("click", () => download(button.dataset.file));
  byId("file").addEventListener("change", (event) => {
    if (event.target.files[0]) measure(event.target.files[0]);
    // Otherwise choosing the same file again, with another calibration, would raise no event.
    event.target.value = "";
  });
  addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dragging"); });
  addEventListener("dragleave", () => document.body.classList.remove("dragging"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dragging");
    for (const file of event.dataTransfer.files) measure(file);
  });
  listenToBall();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refresh);
}

async function begin() {
  storeToken();
  try {
    about = await (await ask("about")).json();
  } catch (error) { return showMessage(error.message); }
  state.form = about.form;
  state.constructions = about.constructions;
  state.roomSource = about.room_source;
  buildRecording(about.recording);
  let start = about.start;
  try { start = JSON.parse(linkedCase()) ?? start; } catch { start = null; }
  const isValid = isCase(start);
  startWith(isValid ? start : about.start, onChange);
  listen();
  await solve();
  if (!isValid) showMessage("the link does not contain a case; allowed: links copied from this page");
}

begin();
