// Section of the source on the floor at an instant, and its animation, in step with the plot of the force.
import { byId } from "thud/page.js";
import { setCursor } from "thud/plot.js";

// Duration of the animation, ms.
const DURATION = 5000;
// Heights of the lower ends of belt and rim of a tyre before the impact, and of its drawing, mm.
const CARCASS = [45, 125];
const TYRE_HEIGHT = 180;
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

/** Return a value between two instants: of numbers, or of lists of them. */
function between(lists, i, part) {
  const mix = (one, other) => (typeof one === "number" ? one + part * (other - one) : one.map((value, k) => mix(value, other[k])));
  return mix(lists[i], lists[i + 1]);
}

function renderBall() {
  const canvas = byId("ball");
  const context = canvas.getContext("2d");
  const styles = getComputedStyle(document.documentElement);
  const color = (name) => styles.getPropertyValue(name).trim();
  const { time, kind, deflection, outer, inner } = motion;
  const at = time[0] + Number(byId("instant").value) * (time.at(-1) - time[0]);
  const next = time.findIndex((instant) => instant > at);
  const i = (next < 0 ? time.length - 1 : next) - 1;
  const valueOf = (lists) => between(lists, i, (at - time[i]) / (time[i + 1] - time[i]));
  const ground = canvas.height - 60;
  const scale = (ground - 20) / heightOf(motion);
  const place = { x: (r) => canvas.width / 2 + scale * r, y: (z) => ground - scale * z };
  context.clearRect(0, 0, canvas.width, canvas.height);
  Object.assign(context, { lineWidth: 2, fillStyle: color("--floor"), strokeStyle: color("--quiet"), font: "20px system-ui, sans-serif" });
  context.fillRect(0, ground, canvas.width, canvas.height);
  context.strokeRect(-2, ground, canvas.width + 4, canvas.height);
  Object.assign(context, { fillStyle: color("--rubber"), strokeStyle: color("--ink") });
  if (kind === "masses") drawMasses(context, place, valueOf(deflection.belt), valueOf(deflection.rim), color("--ink"));
  else drawSection(context, place, kind === "section" ? [outer, inner].map(valueOf) : flattened(valueOf(deflection)));
  const text = `${at.toFixed(1)} ms`;
  byId("instant_text").textContent = text;
  byId("instant").setAttribute("aria-valuetext", text);
  setCursor(byId("force"), at);
  byId("ball_text").textContent = motion.caption;
}

/** Return the largest height of the source, mm. */
function heightOf({ kind, outer, radius }) {
  if (kind === "masses") return TYRE_HEIGHT;
  return kind === "section" ? Math.max(...outer.flat().map(([, z]) => z)) : 2 * radius;
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

/** Draw belt and rim of a tyre, and the springs below them. */
function drawMasses(context, { x, y }, belt, rim, ink) {
  const [beltHeight, rimHeight] = [CARCASS[0] - belt, CARCASS[1] - rim];
  const spring = (r, low, high) => {
    context.beginPath();
    for (let k = 0; k <= 8; k += 1) context.lineTo(x(r + (k % 8 ? (k % 2 ? 7 : -7) : 0)), y(low + (k / 8) * (high - low)));
    context.stroke();
  };
  for (const r of [-40, 40]) spring(r, beltHeight + 25, rimHeight);
  for (const r of [-60, -20, 20, 60]) spring(r, 0, beltHeight);
  for (const [z, width, height, name] of [[beltHeight, 90, 25, "belt"], [rimHeight, 60, 45, "rim"]]) {
    context.beginPath();
    context.roundRect(x(-width), y(z + height), x(width) - x(-width), y(z) - y(z + height), 8);
    context.fill();
    context.stroke();
    const fill = context.fillStyle;
    context.fillStyle = ink;
    context.fillText(name, x(-8), y(z + height / 2) + 6);
    context.fillStyle = fill;
  }
}

/** Return the outer and inner surface of a hollow sphere, flattened by the floor and the wall on it. */
function flattened(newDeflection) {
  const deflection = Math.max(0, newDeflection);
  return [0, motion.wall].map((wall) => {
    const radius = motion.radius - wall;
    return Array.from({ length: 121 }, (_, k) => {
      const angle = (Math.PI * k) / 120;
      return [radius * Math.sin(angle), Math.max(wall, motion.radius - deflection - radius * Math.cos(angle))];
    });
  });
}
