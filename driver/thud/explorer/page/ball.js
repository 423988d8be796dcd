// Section of the ball on the floor at an instant, and its animation.
import { byId, rounded } from "./page.js";

// Duration of the animation, ms.
const DURATION = 4000;
// Maximum displayed displacement of the floor as a fraction of the height of the ball.
const MAX_DISPLACEMENT = 0.12;
let motion = null;
let playing = 0;

/** Show the motion of an answer; hide the section if there is none. */
export function showBall(newMotion) {
  motion = newMotion ?? null;
  byId("ball_section").hidden = !motion;
  if (motion) render();
}

export function listenToBall() {
  byId("play").addEventListener("click", play);
  byId("instant").addEventListener("input", render);
}

function render() {
  const canvas = byId("ball");
  const context = canvas.getContext("2d");
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const last = motion.time.length - 1;
  const i = Math.round(Number(byId("instant").value) * last);
  const top = motion.outer ? Math.max(...motion.outer.flat().map(([, z]) => z)) : 2 * motion.radius;
  const factor = magnification(top);
  const ground = canvas.height - 70;
  const scale = (ground - 20) / Math.max(200, top);
  const x = (r) => canvas.width / 2 + scale * r;
  const y = (z) => ground - scale * (z - factor * motion.floor[i]);
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
  const [outer, inner] = motion.outer ? [motion.outer[i], motion.inner[i]] : flattened(i);
  for (const line of [outer, inner]) {
    line.forEach(([r, z], k) => (k ? context.lineTo(x(r), y(z)) : context.moveTo(x(r), y(z))));
    for (const [r, z] of [...line].reverse()) context.lineTo(x(-r), y(z));
    context.closePath();
  }
  context.fill("evenodd");
  context.stroke();
  const time = `${motion.time[i].toFixed(1)} ms`;
  byId("instant_text").textContent = time;
  byId("instant").setAttribute("aria-valuetext", time);
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
function flattened(i) {
  const deflection = Math.max(0, motion.deflection[i]);
  return [0, motion.wall].map((wall) => {
    const radius = motion.radius - wall;
    return Array.from({ length: 121 }, (_, k) => {
      const angle = (Math.PI * k) / 120;
      return [radius * Math.sin(angle), Math.max(wall, motion.radius - deflection - radius * Math.cos(angle))];
    });
  });
}

function play() {
  const starts = !playing;
  byId("play").textContent = starts ? "Pause" : "Play";
  cancelAnimationFrame(playing);
  playing = 0;
  if (!starts) return;
  let last = performance.now();
  const step = (now) => {
    const slider = byId("instant");
    slider.value = (Number(slider.value) + (now - last) / DURATION) % 1;
    last = now;
    if (motion) render();
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}
