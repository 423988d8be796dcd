// Section of the source on the floor at an instant, and its animation, in step with the plot of the force.
import { byId, rounded } from "./page.js";
import { setCursor } from "./plot.js";

// Duration of the animation, ms.
const DURATION = 5000;
// Maximum displayed displacement of the floor as a fraction of the height of the ball.
const MAX_DISPLACEMENT = 0.12;
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
  const top = motion.outer ? Math.max(...motion.outer.flat().map(([, z]) => z)) : 2 * motion.radius;
  const factor = magnification(top);
  const floor = factor * between(motion.floor, i, part);
  const ground = canvas.height - 60;
  const scale = (ground - 20) / Math.max(200, top);
  const x = (r) => canvas.width / 2 + scale * r;
  const y = (z) => ground - scale * (z - floor);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.lineWidth = 2;
  context.fillStyle = color("--floor");
  context.fillRect(0, y(0), canvas.width, canvas.height);
  context.strokeStyle = color("--quiet");
  context.beginPath();
  context.moveTo(0, y(0));
  context.lineTo(canvas.width, y(0));
  context.stroke();
  context.fillStyle = color("--rubber");
  context.strokeStyle = color("--ink");
  context.beginPath();
  const [outer, inner] = motion.outer ? [between(motion.outer, i, part), between(motion.inner, i, part)] : flattened(between(motion.deflection, i, part));
  for (const line of [outer, inner]) {
    line.forEach(([r, z], k) => (k ? context.lineTo(x(r), y(z)) : context.moveTo(x(r), y(z))));
    for (const [r, z] of [...line].reverse()) context.lineTo(x(-r), y(z));
    context.closePath();
  }
  context.fill("evenodd");
  context.stroke();
  const text = `${at.toFixed(1)} ms`;
  byId("instant_text").textContent = text;
  byId("instant").setAttribute("aria-valuetext", text);
  setCursor(byId("force"), at);
  const shape = motion.outer ? "Computed section." : "Shape that the model assumes: a sphere, flattened by its deflection.";
  const displacement = factor > 1 ? ` The floor moves by up to ${rounded(Math.max(...motion.floor), "mm")}, magnified ${factor}×.` : "";
  byId("ball_text").textContent = shape + displacement;
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
