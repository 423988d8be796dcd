// The page: requests the values of the form from the server; the latest request wins.
import { build, caseValues, changedWords, isCase, mark, startWith, state, titleOf } from "./form.js";
import { byId, element } from "./page.js";
import { listenToBall } from "./ball.js";
import { Loss, Refusal, ask, follow, linkedCase, takeToken } from "./request.js";
import { show } from "./results.js";

// Pause of the changes before a slow case is requested, and time between tries to reach the server, ms.
const REST = 120;
const RETRY = 1500;
const pinned = [];
let about = null;
let current = null;
let job = null;
let timer = 0;
let tries = 0;

// ---- Messages.

function say(message) {
  byId("message").textContent = message;
  byId("message").hidden = false;
}

function hush() {
  byId("message").hidden = true;
  document.body.classList.remove("old");
  mark(null);
}

/** Show an error; if the server is gone, wait for it. */
function fail(error) {
  if (error.name === "AbortError") return;
  if (!(error instanceof Loss || error instanceof Refusal)) throw error;
  say(error.message);
  mark(error.message);
  if (error instanceof Loss) {
    clearTimeout(tries);
    tries = setTimeout(() => ask("about").then(() => { hush(); solve(); }, fail), RETRY);
  }
}

// ---- Tasks of the server.

/** Follow a task; show it with a button to cancel it, by default from its first report. */
async function runTask(name, path, body, stop, { atOnce = false, reported = () => {} } = {}) {
  const bar = element("progress", { max: 1, "aria-label": name });
  const button = element("button", { type: "button" }, "Cancel");
  button.addEventListener("click", () => stop.abort());
  const line = element("div", { class: "task" }, element("span", {}, name), bar, button);
  const appear = () => { if (!line.isConnected) byId("tasks").append(line); };
  if (atOnce) appear();
  try {
    return await follow(path, body, stop.signal, (fraction) => {
      appear();
      if (fraction > 0) bar.value = fraction;
      reported();
    });
  } finally {
    line.remove();
  }
}

/** Request the case; a new request cancels a slow one and waits for a quick one. */
async function solve() {
  clearTimeout(timer);
  if (job && !job.slow) { job.again = true; return; }
  job?.stop.abort();
  const own = { stop: new AbortController(), slow: false, again: false, start: performance.now() };
  job = own;
  try {
    const answer = await runTask("Computing", "solve", JSON.stringify(caseValues()), own.stop, { reported: () => { own.slow = true; } });
    hush();
    current = { name: titleOf("model", state.model), short: titleOf("model", state.model), words: changedWords(), answer, slow: own.slow };
    refresh();
    // From the request to the next picture, for tests and benchmarks.
    requestAnimationFrame(() => { document.body.dataset.latency = String(performance.now() - own.start); });
  } catch (error) {
    if (error.name !== "AbortError") document.body.classList.add("old");
    fail(error);
  } finally {
    if (job === own) {
      job = null;
      if (own.again) solve();
    }
  }
}

/** Request the case after a change of the form; a slow case only when changes pause. */
function changed() {
  if (!(job ?? current)?.slow) return solve();
  job?.stop.abort();
  clearTimeout(timer);
  timer = setTimeout(solve, REST);
}

async function measure(file) {
  if (file.size > about.largest) return say(`${file.name} is longer than ${about.largest / 1e6} MB; allowed: shorter`);
  const query = new URLSearchParams({ name: file.name });
  for (const key of ["height", "mass", "calibration", "unit", "channel"]) {
    const value = byId(`recording_${key}`).value;
    if (value) query.set(key, value);
  }
  try {
    const answer = await runTask(`Measuring ${file.name}`, `measure?${query}`, file, new AbortController(), { atOnce: true });
    hush();
    const name = `${file.name}, ${answer.drops} drop${answer.drops === 1 ? "" : "s"}`;
    pinned.push({ name, short: name, words: answer.verdict, answer, pinned: true });
    refresh();
  } catch (error) { fail(error); }
}

async function download(name) {
  const values = caseValues();
  if (name === "study.toml") values.moved = state.moved;
  try {
    const response = await ask(`download/${name}`, { method: "POST", body: JSON.stringify(values) });
    const link = element("a", { href: URL.createObjectURL(await response.blob()), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    hush();
  } catch (error) { fail(error); }
}

function refresh() {
  show(current ? [current, ...pinned] : pinned, (variant) => { pinned.splice(pinned.indexOf(variant), 1); refresh(); });
}

// ---- Events.

function pin() {
  if (!current) return;
  const letter = String.fromCharCode(65 + (pinned.filter((variant) => variant.letter).length % 26));
  pinned.push({ ...current, name: `${letter}: ${current.name}`, short: `${letter}: ${current.name}`, letter, pinned: true });
  refresh();
}

async function link() {
  const address = `${location.origin}/#case=${encodeURIComponent(JSON.stringify(caseValues()))}`;
  history.replaceState(null, "", address);
  const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
  byId("link").textContent = copied ? "Link copied" : "Link is in the address bar";
  setTimeout(() => { byId("link").textContent = "Copy link"; }, 2000);
}

function listen() {
  byId("form").addEventListener("submit", (event) => event.preventDefault());
  const rebuild = () => {
    // Take the text being typed before its field is replaced.
    if (byId("form").contains(document.activeElement) && document.activeElement.matches("input")) document.activeElement.blur();
    build(changed);
    changed();
  };
  byId("model").addEventListener("change", (event) => { state.model = event.target.value; rebuild(); });
  byId("floor").addEventListener("change", (event) => {
    state.floor = event.target.value;
    state.room &&= Boolean(state.floor);
    rebuild();
  });
  byId("has_room").addEventListener("change", (event) => {
    state.room = event.target.checked;
    if (state.room) state.floor ||= "plate";
    rebuild();
  });
  byId("pin").addEventListener("click", pin);
  byId("reset").addEventListener("click", () => { pinned.length = 0; startWith(about.start, changed); changed(); });
  byId("link").addEventListener("click", link);
  for (const button of document.querySelectorAll("[data-file]")) button.addEventListener("click", () => download(button.dataset.file));
  byId("file").addEventListener("change", (event) => {
    if (event.target.files[0]) measure(event.target.files[0]);
    // The same file may be chosen again, with another calibration.
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
  takeToken();
  try {
    about = await (await ask("about")).json();
  } catch (error) { return say(error.message); }
  state.form = about.form;
  let start = about.start;
  try { start = JSON.parse(linkedCase()) ?? start; } catch { start = null; }
  const known = isCase(start);
  startWith(known ? start : about.start, changed);
  listen();
  await solve();
  if (!known) say("the link holds no case; allowed: one that this page has copied");
}

begin();
