// Section of the source on the floor at an instant, and its animation, in step with the plot of the force.
import { byId, rounded } from "./page.js";
import { setCursor } from "./plot.js";

// Duration of the animation, ms.
const DURATION = 5000;
// Maximum displayed displacement of the floor as a fraction of the height of the ball.
const MAX_DISPLACEMENT = 0.12;
// Heights of the lower ends of belt and rim of a tyre before the impact, and of its drawing, mm.
const CARCASS = [45, 125];
const TYRE_HEIGHT = 180;
// Colors from the lowest to the highest value (viridis).
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const isStill = matchMedia("(prefers-reduced-motion: reduce)");
let motion = null;
let playing = 0;
let endsAfterPass = false;
let hasPlayed = false;

/** Show the motion of an answer; hide the section if there is none. Without a wish for less motion it plays once. */
export function showBall(newMotion) {
  motion = newMotion ?? null;
  byId("ball_section").hidden = !motion;
  if (!motion) { stopBall(); setCursor(byId("force"), null); return; }
  renderBall();
  if (!hasPlayed && !isStill.matches) startBall(true);
  hasPlayed = true;
}

export function listenToBall() {
  byId("play").addEventListener("click", () => (playing ? stopBall() : startBall(false)));
  byId("instant").addEventListener("input", () => { stopBall(); renderBall(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (motion) renderBall(); });
}

function stopBall() {
  cancelAnimationFrame(playing);
  playing = 0;
  byId("play").textContent = "Play";
}

function startBall(once) {
  endsAfterPass = once;
  byId("play").textContent = "Pause";
  let [last, passed] = [performance.now(), 0];
  const step = (now) => {
    const slider = byId("instant");
    const part = (now - last) / DURATION;
    last = now;
    passed += part;
    slider.value = (Number(slider.value) + part) % 1;
    if (motion) renderBall();
    if (endsAfterPass && passed >= 1) stopBall();
    else playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

/** Return a value between two instants: of numbers, or of lists of them. */
function between(lists, i, part) {
  const mix = (one, other) => (typeof one === "number" ? one + part * (other - one) : one.map((value, k) => mix(value, other[k])));
  return part ? mix(lists[i], lists[i + 1]) : lists[i];
}

function renderBall() {
  const canvas = byId("ball");
  const context = canvas.getContext("2d");
  const styles = getComputedStyle(document.documentElement);
  const color = (name) => styles.getPropertyValue(name).trim();
  const { time } = motion;
  const at = time[0] + Number(byId("instant").value) * (time.at(-1) - time[0]);
  let i = 0;
  while (i < time.length - 2 && time[i + 1] <= at) i += 1;
  const part = (at - time[i]) / (time[i + 1] - time[i]);
  const top = heightOf(motion);
  const floor = magnification(top) * between(motion.floor, i, part);
  const ground = canvas.height - 60;
  const scale = (ground - 20) / top;
  const place = { x: (r) => canvas.width / 2 + scale * r, y: (z) => ground - scale * (z - floor) };
  context.clearRect(0, 0, canvas.width, canvas.height);
  Object.assign(context, { lineWidth: 2, fillStyle: color("--floor"), strokeStyle: color("--quiet"), font: "20px system-ui, sans-serif" });
  context.fillRect(0, place.y(0), canvas.width, canvas.height);
  context.beginPath();
  context.moveTo(0, place.y(0));
  context.lineTo(canvas.width, place.y(0));
  context.stroke();
  Object.assign(context, { fillStyle: color("--rubber"), strokeStyle: color("--ink") });
  if (motion.kind === "masses") drawMasses(context, place, between(motion.deflection.belt, i, part), between(motion.deflection.rim, i, part), color("--ink"));
  else drawSection(context, place, motion.kind === "section" ? [between(motion.outer, i, part), between(motion.inner, i, part)] : flattened(between(motion.deflection, i, part)));
  if (motion.mesh) drawColors(context, place, between(motion.mesh.nodes, i, part), between(motion.color.value, i, part), color("--ink"));
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

/** Draw the elements in colors of their values, and the scale. */
function drawColors(context, { x, y }, nodes, values, ink) {
  const most = Math.max(...motion.color.value.flat(2));
  for (const side of [1, -1]) {
    values.forEach((row, i) => row.forEach((value, j) => {
      context.beginPath();
      for (const [r, z] of [nodes[i][j], nodes[i][j + 1], nodes[i + 1][j + 1], nodes[i + 1][j]]) context.lineTo(x(side * r), y(z));
      context.closePath();
      context.fillStyle = colorAt(value / most);
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 0.7;
      context.fill();
      context.stroke();
    }));
  }
  const [left, top, height] = [context.canvas.width - 110, 30, 160];
  for (let k = 0; k < height; k += 1) {
    context.fillStyle = colorAt(1 - k / height);
    context.fillRect(left, top + k, 18, 1.5);
  }
  context.fillStyle = ink;
  context.fillText(rounded(Number(most.toPrecision(2)), motion.color.unit), left + 26, top + 14);
  context.fillText("0", left + 26, top + height);
}

/** Return the color of a fraction of the scale. */
function colorAt(fraction) {
  const at = Math.min(1, Math.max(0, fraction)) * (RAMP.length - 1);
  const i = Math.min(RAMP.length - 2, Math.floor(at));
  return `rgb(${RAMP[i].map((value, k) => Math.round(value + (at - i) * (RAMP[i + 1][k] - value))).join(" ")})`;
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

/** Return the round factor by which the displacement of the floor is magnified; `top` is the height of the ball. */
function magnification(top) {
  const maximum = Math.max(...motion.floor);
  if (!(maximum > 0)) return 1;
  const limit = (MAX_DISPLACEMENT * top) / maximum;
  const power = 10 ** Math.floor(Math.log10(limit));
  return Math.max(1, power * [5, 2, 1].find((factor) => factor * power <= limit));
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
