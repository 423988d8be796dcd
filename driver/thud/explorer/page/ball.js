// Section of the source on the floor at an instant, and its animation, in step with the plot of the force.
import { byId } from "thud/page.js";
import { setCursor } from "thud/plot.js";

// Duration of the animation, ms.
const DURATION = 5000;
let motion = null;
let playing = 0;

/** Show the motion of an answer; hide the section if there is none. */
export function showBall(newMotion) {
  motion = newMotion ?? null;
  byId("ball_section").hidden = !motion;
  if (!motion) { stopBall(); setCursor(byId("force"), null); return; }
  renderBall();
}

export function listenToBall() {
  byId("play").addEventListener("click", () => (playing ? stopBall() : startBall()));
  byId("instant").addEventListener("input", () => { stopBall(); renderBall(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (motion) renderBall(); });
}

function stopBall() {
  cancelAnimationFrame(playing);
  playing = 0;
  byId("play").textContent = "Play";
}

function startBall() {
  byId("play").textContent = "Pause";
  let last = performance.now();
  const step = (now) => {
    const slider = byId("instant");
    slider.value = (Number(slider.value) + (now - last) / DURATION) % 1;
    last = now;
    if (motion) renderBall();
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

function renderBall() {
  const canvas = byId("ball");
  const context = canvas.getContext("2d");
  const styles = getComputedStyle(document.documentElement);
  const color = (name) => styles.getPropertyValue(name).trim();
  const { time, outer, inner } = motion;
  const at = time[0] + Number(byId("instant").value) * (time.at(-1) - time[0]);
  const next = time.findIndex((instant) => instant > at);
  const i = (next < 0 ? time.length - 1 : next) - 1;
  const part = (at - time[i]) / (time[i + 1] - time[i]);
  const mix = (one, other) => one + part * (other - one);
  const lineOf = (lines) => lines[i].map((point, k) => point.map((x, j) => mix(x, lines[i + 1][k][j])));
  const ground = canvas.height - 60;
  const scale = (ground - 20) / Math.max(...outer.flat().map(([, z]) => z));
  const place = { x: (r) => canvas.width / 2 + scale * r, y: (z) => ground - scale * z };
  context.clearRect(0, 0, canvas.width, canvas.height);
  Object.assign(context, { lineWidth: 2, fillStyle: color("--floor"), strokeStyle: color("--quiet") });
  context.fillRect(0, ground, canvas.width, canvas.height);
  context.strokeRect(-2, ground, canvas.width + 4, canvas.height);
  Object.assign(context, { fillStyle: color("--rubber"), strokeStyle: color("--ink") });
  drawSection(context, place, [outer, inner].map(lineOf));
  const text = `${at.toFixed(1)} ms`;
  byId("instant_text").textContent = text;
  byId("instant").setAttribute("aria-valuetext", text);
  setCursor(byId("force"), at);
  byId("ball_text").textContent = motion.is_computed ? "Computed section."
    : "A sphere, flattened by the deflection of the ball.";
}

function drawSection(context, { x, y }, lines) {
  context.beginPath();
  for (const line of lines) {
    line.forEach(([r, z], k) => (k ? context.lineTo(x(r), y(z)) : context.moveTo(x(r), y(z))));
    for (const [r, z] of [...line].reverse()) context.lineTo(x(-r), y(z));
    context.closePath();
  }
  context.fill("evenodd");
  context.stroke();
}
