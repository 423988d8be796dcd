"use strict";
// The page: fields from the declarations of the keys, one request at a time, the latest values win.

const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
const byId = (id) => document.getElementById(id);
const token = takeToken();
const state = { values: {}, model: "", floor: "", room: false, moved: {}, pinned: [], answer: null };
let about = null;
let busy = false;
let waiting = false;
let stopper = null;
let timer = 0;

// ---- Address: the token once, and the case of a link.

function parameters() {
  return new URLSearchParams(location.hash.slice(1));
}

function takeToken() {
  const given = parameters();
  const found = given.get("token");
  if (found) {
    localStorage.setItem("token", found);
    given.delete("token");
    history.replaceState(null, "", given.size ? "#" + given : location.pathname);
  }
  return found || localStorage.getItem("token") || "";
}

function ask(path, options = {}) {
  return fetch(path, { ...options, headers: { ...options.headers, "X-Thud-Token": token } });
}

// ---- The form.

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(key, "");
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

function title(text) {
  const words = text.replaceAll("_", " ");
  return words[0].toUpperCase() + words.slice(1);
}

function current(field) {
  const given = state.values[field.group]?.[field.name];
  return given === undefined ? field.default : given;
}

function put(field, value) {
  const same = JSON.stringify(value) === JSON.stringify(field.default);
  const group = (state.values[field.group] ??= {});
  if (same) delete group[field.name];
  else group[field.name] = value;
  if (!Object.keys(group).length) delete state.values[field.group];
}

function fieldElement(field) {
  const id = `${field.group}.${field.name}`;
  const label = element("label", { for: id, id: `${id}.label` }, title(field.meaning) + (field.unit ? `, ${field.unit}` : ""));
  const changed = (value) => { put(field, value); schedule(); };
  if (field.kind === "choice") {
    const select = element("select", { id }, ...field.choices.map((one) => element("option", { value: one }, one.replaceAll("_", " "))));
    select.value = current(field);
    select.addEventListener("change", () => changed(select.value));
    return element("div", { class: "field" }, label, select);
  }
  if (field.kind === "flag") {
    const box = element("input", { id, type: "checkbox" });
    box.checked = current(field);
    box.addEventListener("change", () => changed(box.checked));
    return element("div", { class: "field" }, label, box);
  }
  if (field.kind === "list") {
    const text = element("input", { id, type: "text", size: 26, value: current(field).join(" ") });
    text.addEventListener("change", () => {
      const numbers = text.value.split(/[\s;,]+/).filter(Boolean).map(Number);
      text.setAttribute("aria-invalid", String(numbers.some(Number.isNaN)));
      if (!numbers.some(Number.isNaN)) changed(numbers);
    });
    return element("div", { class: "field" }, label, text);
  }
  const whole = field.kind === "whole";
  const number = element("input", { id, type: "number", step: whole ? 1 : "any", min: field.lower, max: field.upper, value: current(field) });
  const pair = element("div", { class: "pair" }, number);
  let slider = null;
  const send = (value) => {
    const key = `${field.group}.${field.name}`;
    const ends = (state.moved[key] ??= [current(field), current(field)]);
    state.moved[key] = [Math.min(ends[0], value), Math.max(ends[1], value)];
    changed(value);
  };
  if (field.slider) {
    const [low, high] = field.slider;
    // A slider of a positive number moves in its logarithm.
    const logarithmic = low > 0 && high / low > 4 && !whole;
    const to = logarithmic ? Math.log : (x) => x;
    const from = logarithmic ? Math.exp : (x) => x;
    slider = element("input", { type: "range", "aria-labelledby": `${id}.label`, min: to(low), max: to(high), step: whole ? 1 : "any" });
    slider.value = to(current(field));
    slider.addEventListener("input", () => {
      const value = whole ? Math.round(from(Number(slider.value))) : Number(from(Number(slider.value)).toPrecision(4));
      number.value = value;
      slider.setAttribute("aria-valuetext", `${value} ${field.unit}`);
      number.setAttribute("aria-invalid", "false");
      send(value);
    });
    slider.setAttribute("aria-valuetext", `${current(field)} ${field.unit}`);
    pair.append(slider);
    slider.place = (value) => { slider.value = to(value); slider.setAttribute("aria-valuetext", `${value} ${field.unit}`); };
  }
  number.addEventListener("change", () => {
    const value = Number(number.value);
    const bad = number.value === "" || !Number.isFinite(value);
    number.setAttribute("aria-invalid", String(bad));
    if (bad) return say(`${field.group}: ${field.name} is not a number; allowed: a number`);
    if (slider) slider.place(value);
    send(value);
  });
  return element("div", { class: "field" }, label, pair);
}

function groupElement(group, open) {
  return element("details", { open }, element("summary", {}, title(group.name)), ...group.fields.map(fieldElement));
}

function buildForm() {
  const groups = byId("groups");
  const own = about.form.filter((group) => group.part === group.name && group.part !== "room");
  const model = about.form.find((group) => group.part === "model" && group.name === state.model);
  const floor = about.form.find((group) => group.part === "floor" && group.name === state.floor);
  const room = about.form.find((group) => group.part === "room");
  groups.replaceChildren(
    ...own.filter((group) => ["ball", "drop"].includes(group.name)).map((group) => groupElement(group, true)),
    groupElement(model, true),
    ...own.filter((group) => !["ball", "drop"].includes(group.name)).map((group) => groupElement(group, false)));
  byId("floor_groups").replaceChildren(...(floor && floor.fields.length ? [groupElement(floor, true)] : []));
  byId("room_groups").replaceChildren(...(state.room ? [groupElement(room, true)] : []));
  byId("model").value = state.model;
  byId("floor").value = state.floor;
  byId("has_room").checked = state.room;
}

function fillChoices() {
  const names = (part) => about.form.filter((group) => group.part === part).map((group) => group.name);
  const options = (list) => list.map((name) => element("option", { value: name }, name.replaceAll("_", " ")));
  byId("model").replaceChildren(...options(names("model")));
  byId("floor").replaceChildren(element("option", { value: "" }, "none but the rigid one"), ...options(names("floor")));
}

// ---- The case as groups of keys.

function used(part, name) {
  const found = about.form.find((group) => group.part === part && group.name === name);
  return new Set(found ? found.fields.map((field) => field.group) : []);
}

function caseValues() {
  const groups = new Set(about.form.filter((group) => group.part === group.name && group.part !== "room").map((group) => group.name));
  for (const group of used("model", state.model)) groups.add(group);
  if (state.floor) for (const group of used("floor", state.floor)) groups.add(group);
  if (state.room) groups.add("room");
  const found = { case: { name: "explored" }, model: { name: state.model } };
  if (state.floor) found.floor = { name: state.floor };
  for (const group of groups) if (state.values[group]) found[group] = state.values[group];
  if (state.room && !found.room) found.room = {};
  return found;
}

function startWith(values) {
  const { case: _, model, floor, ...rest } = values;
  const names = about.form.filter((group) => group.part === "model").map((group) => group.name);
  state.model = model?.name ?? names[0];
  state.floor = floor?.name ?? "";
  state.room = "room" in rest;
  state.values = {};
  state.moved = {};
  for (const group of about.form) {
    for (const field of group.fields) {
      let value = rest[field.group]?.[field.name];
      if (value === undefined || (group.part === "model" && group.name !== state.model)) continue;
      if (field.kind === "list" && !Array.isArray(value)) value = [value];
      put(field, value);
    }
  }
  buildForm();
}

// ---- Requests.

function schedule() {
  clearTimeout(timer);
  if (about.slow.includes(state.model)) {
    // Whoever moves on does not wait for what was asked before.
    stopper?.abort();
    timer = setTimeout(() => follow("solve_slowly", JSON.stringify(caseValues()), "Computing the impact", show), 250);
  } else {
    solve();
  }
}

async function solve() {
  if (busy) { waiting = true; return; }
  busy = true;
  do {
    waiting = false;
    stopper?.abort();
    try {
      const start = performance.now();
      const response = await ask("solve", { method: "POST", body: JSON.stringify(caseValues()) });
      if (response.ok) {
        show(await response.json());
        document.body.dataset.latency = String(performance.now() - start);
      } else say(await response.text());
    } catch { say("the server does not answer; start it again with: thud-driver explore"); }
  } while (waiting && !about.slow.includes(state.model));
  busy = false;
}

async function follow(path, body, name, done) {
  const own = new AbortController();
  stopper?.abort();
  stopper = own;
  byId("work").hidden = false;
  byId("work_name").textContent = name;
  byId("progress").removeAttribute("value");
  try {
    const response = await ask(path, { method: "POST", body, signal: own.signal });
    if (!response.ok) return say(await response.text());
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let rest = "";
    for (;;) {
      const { value, done: over } = await reader.read();
      if (over) break;
      const lines = (rest + value).split("\n");
      rest = lines.pop();
      for (const line of lines) {
        const report = JSON.parse(line);
        if ("done" in report) byId("progress").value = report.done;
        else if ("error" in report) say(report.error);
        else done(report.answer);
      }
    }
  } catch (error) {
    if (error.name !== "AbortError") say("the server does not answer; start it again with: thud-driver explore");
  } finally {
    if (stopper === own) { stopper = null; byId("work").hidden = true; }
  }
}

function measure(file) {
  const query = new URLSearchParams({ name: file.name });
  for (const key of ["height", "mass", "calibration", "unit", "channel"]) {
    const given = byId(`recording_${key}`).value;
    if (given) query.set(key, given);
  }
  follow(`measure?${query}`, file, `Measuring ${file.name}`, (answer) => {
    hush();
    state.pinned.push({ name: `${file.name} (${answer.drops} drop${answer.drops === 1 ? "" : "s"}): ${answer.verdict}`, answer });
    draw();
  });
}

async function download(name) {
  const values = caseValues();
  if (name === "study.toml") values.moved = state.moved;
  try {
    const response = await ask(`download/${name}`, { method: "POST", body: JSON.stringify(values) });
    if (!response.ok) return say(await response.text());
    const link = element("a", { href: URL.createObjectURL(await response.blob()), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  } catch { say("the server does not answer; start it again with: thud-driver explore"); }
}

function say(sentence) {
  byId("message").textContent = sentence;
  byId("message").hidden = false;
}

function hush() { byId("message").hidden = true; }

// ---- What is shown.

function show(answer) {
  hush();
  state.answer = answer;
  draw();
}

function variants() {
  const own = state.answer ? [{ name: title(state.model), answer: state.answer }] : [];
  return [...own, ...state.pinned];
}

function look() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  const axis = { gridcolor: of("--line"), zerolinecolor: of("--line"), automargin: true };
  return {
    base: {
      margin: { l: 55, r: 10, t: 10, b: 40 }, paper_bgcolor: of("--paper"), plot_bgcolor: of("--paper"),
      font: { color: of("--ink"), size: 13 }, showlegend: variants().length > 1,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", font: { size: 11 } },
    },
    axis, band: of("--band"), ink: of("--ink"), line: of("--line"),
  };
}

const CONFIG = { displayModeBar: false, responsive: true };

function trace(i, one, x, y, mode) {
  return { x, y, mode, name: one.name, line: { color: COLOURS[i % 6], dash: DASHES[i % 6] }, marker: { symbol: i, size: 8, color: COLOURS[i % 6] } };
}

function draw() {
  const all = variants();
  if (!all.length) return;
  const { base, axis, band } = look();
  Plotly.react("force", all.map((one, i) => trace(i, one, one.answer.force.time, one.answer.force.force, "lines")),
    { ...base, xaxis: { ...axis, title: { text: "Time, ms" } }, yaxis: { ...axis, title: { text: "Force, N" } } }, CONFIG);
  const octaves = all[0].answer.levels.octave.frequency.map((f) => String(f));
  const limits = all[0].answer.criteria.filter((one) => one.name.startsWith("octave_"));
  Plotly.react("levels", all.map((one, i) => trace(i, one, octaves, one.answer.levels.octave.level, "lines+markers")), {
    ...base, xaxis: { ...axis, type: "category", range: [-0.5, octaves.length - 0.5], title: { text: "Octave band, Hz" } },
    yaxis: { ...axis, title: { text: "Level, dB re 1 N" } },
    shapes: limits.map((one, i) => ({ type: "rect", layer: "below", x0: i - 0.4, x1: i + 0.4, y0: one.lower, y1: one.upper, fillcolor: band, line: { width: 0 } })),
  }, CONFIG);
  const rooms = all.filter((one) => one.answer.room);
  byId("room_section").hidden = !rooms.length;
  if (rooms.length) {
    const thirds = rooms[0].answer.room.frequency.map((f) => String(f));
    Plotly.react("room", rooms.map((one, i) => trace(all.indexOf(one), one, thirds, one.answer.room.level, "lines+markers")),
      { ...base, xaxis: { ...axis, type: "category", title: { text: "Third-octave band, Hz" } }, yaxis: { ...axis, title: { text: "L_i,Fmax, dB" } } }, CONFIG);
    byId("room_words").textContent = rooms.map((one) => `${one.name}: L_iA,Fmax ${one.answer.room.rating} dB, standardised ${one.answer.room.standardised} dB`).join("; ");
  }
  describe(all);
  drawTable(all);
  drawBall();
}

function describe(all) {
  const answer = all[0].answer;
  const missed = answer.criteria.filter((one) => !one.conforms).map((one) => one.name.replaceAll("_", " "));
  const words = answer.conforms ? "conforms to the standards" : `${answer.verdict ?? "does not conform"}: ${missed.join(", ")}`;
  byId("verdict").textContent = `${all[0].name} ${words}`;
  byId("verdict").className = answer.conforms ? "conforms" : "fails";
  const numbers = Object.entries(answer.numbers).map(([name, value]) => `${name} ${rounded(value)}`).join("; ");
  byId("force").setAttribute("aria-label", `Force against time: ${numbers}`);
  byId("levels").setAttribute("aria-label", "Octave levels over the tolerance band: " + answer.criteria
    .filter((one) => one.name.startsWith("octave_")).map((one) => `${one.name.slice(7).replace("_", ".")} Hz ${rounded(one.value)} dB`).join("; "));
  byId("remarks").replaceChildren(...all.flatMap((one) => one.answer.remarks.map((remark) => element("li", {}, `${one.name}: ${remark}`))));
}

function rounded(value) {
  return value === null || value === undefined ? "not known" : Number(value.toPrecision(4)).toString();
}

function drawTable(all) {
  const cell = (one) => {
    const away = one.value < one.lower ? " low" : one.value > one.upper ? " high" : "";
    return element("td", { class: one.conforms ? "conforms" : "fails" }, one.value === null ? "not known" : `${rounded(one.value)}${away}`);
  };
  const rows = all[0].answer.criteria.map((one, i) => element("tr", {},
    element("th", { scope: "row" }, one.name.replace(/(\d)_(\d)/, "$1.$2").replaceAll("_", " ") + (one.unit ? `, ${one.unit}` : "")),
    element("td", {}, `${one.lower} to ${one.upper}`), ...all.map((other) => cell(other.answer.criteria[i]))));
  const heads = all.map((one, i) => {
    const head = element("th", { scope: "col" }, one.name);
    if (one !== all[0] || !state.answer) {
      const button = element("button", { type: "button", "aria-label": `Remove ${one.name}` }, "×");
      button.addEventListener("click", () => { state.pinned = state.pinned.filter((other) => other !== one); draw(); });
      head.append(" ", button);
    }
    return head;
  });
  byId("criteria").replaceChildren(
    element("caption", {}, "Values beside the limits of the standards"),
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "Criterion"), element("th", { scope: "col" }, "Limits"), ...heads)),
    element("tbody", {}, ...rows));
}

// ---- The ball.

function drawBall() {
  const motion = state.answer?.motion;
  const canvas = byId("ball");
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (!motion) return;
  const { ink, line, band } = look();
  const part = Number(byId("instant").value);
  const i = Math.min(motion.time.length - 1, Math.round(part * (motion.time.length - 1)));
  const ground = canvas.height - 30;
  const scale = (canvas.height - 60) / 200;
  const x = (r) => canvas.width / 2 + scale * r;
  const y = (z) => ground - scale * z;
  context.strokeStyle = ink;
  context.fillStyle = band;
  context.lineWidth = 2;
  const path = (points) => {
    points.forEach(([r, z], k) => (k ? context.lineTo(x(r), y(z)) : context.moveTo(x(r), y(z))));
    [...points].reverse().forEach(([r, z]) => context.lineTo(x(-r), y(z)));
    context.closePath();
  };
  context.beginPath();
  if (motion.outer) {
    path(motion.outer[i]);
    path(motion.inner[i]);
    byId("ball_words").textContent = "Computed shape, half section mirrored.";
  } else {
    path(flattened(motion.radius, Math.max(0, motion.deflection[i])));
    path(flattened(motion.radius - motion.wall, Math.max(0, motion.deflection[i]), motion.wall));
    byId("ball_words").textContent = "This model has no snapshots: a sphere flattened by the deflection.";
  }
  context.fill("evenodd");
  context.stroke();
  context.strokeStyle = line;
  context.beginPath();
  context.moveTo(0, ground + 1);
  context.lineTo(canvas.width, ground + 1);
  context.stroke();
  byId("instant_words").textContent = `${motion.time[i].toFixed(1)} ms`;
}

function flattened(radius, deflection, wall = 0) {
  // The lower part of the sphere lies flat on the floor, the wall on it.
  const centre = radius + wall - deflection;
  const points = [];
  for (let k = 0; k <= 60; k += 1) {
    const angle = (Math.PI * k) / 60;
    points.push([radius * Math.sin(angle), Math.max(wall, centre - radius * Math.cos(angle))]);
  }
  return points;
}

let playing = 0;
function play() {
  const on = !playing;
  byId("play").setAttribute("aria-pressed", String(on));
  byId("play").textContent = on ? "Pause" : "Play";
  cancelAnimationFrame(playing);
  playing = 0;
  if (!on) return;
  let last = performance.now();
  const step = (now) => {
    const slider = byId("instant");
    slider.value = (Number(slider.value) + (now - last) / 4000) % 1;
    last = now;
    drawBall();
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

// ---- Events.

function listen() {
  const changed = () => { buildForm(); schedule(); };
  byId("form").addEventListener("submit", (event) => event.preventDefault());
  byId("model").addEventListener("change", (event) => { state.model = event.target.value; changed(); });
  byId("floor").addEventListener("change", (event) => {
    state.floor = event.target.value;
    if (!state.floor) state.room = false;
    changed();
  });
  byId("has_room").addEventListener("change", (event) => {
    state.room = event.target.checked;
    if (state.room && !state.floor) state.floor = "plate";
    changed();
  });
  byId("pin").addEventListener("click", () => {
    if (!state.answer) return;
    state.pinned.push({ name: `${String.fromCharCode(65 + (state.pinned.length % 26))}: ${state.model.replaceAll("_", " ")}`, answer: state.answer });
    draw();
  });
  byId("reset").addEventListener("click", () => { state.pinned = []; startWith(about.start); schedule(); });
  byId("link").addEventListener("click", async () => {
    const address = `${location.origin}/#case=${encodeURIComponent(JSON.stringify(caseValues()))}`;
    history.replaceState(null, "", address);
    try { await navigator.clipboard.writeText(address); byId("link").textContent = "Link copied"; } catch { byId("link").textContent = "Link is in the address bar"; }
    setTimeout(() => { byId("link").textContent = "Copy link"; }, 2000);
  });
  byId("cancel").addEventListener("click", () => stopper?.abort());
  byId("play").addEventListener("click", play);
  byId("instant").addEventListener("input", drawBall);
  for (const button of document.querySelectorAll("[data-file]")) button.addEventListener("click", () => download(button.dataset.file));
  byId("file").addEventListener("change", (event) => { if (event.target.files[0]) measure(event.target.files[0]); });
  addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dragging"); });
  addEventListener("dragleave", () => document.body.classList.remove("dragging"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dragging");
    if (event.dataTransfer.files[0]) measure(event.dataTransfer.files[0]);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

async function begin() {
  let response = null;
  try { response = await ask("about"); } catch { return say("the server does not answer; start it again with: thud-driver explore"); }
  if (!response.ok) return say(await response.text());
  about = await response.json();
  fillChoices();
  let start = about.start;
  const linked = parameters().get("case");
  if (linked) {
    try { start = JSON.parse(linked); } catch { say("the link holds no case; allowed: one that this page has copied"); }
  }
  startWith(start && typeof start === "object" ? start : {});
  listen();
  schedule();
}

begin();
