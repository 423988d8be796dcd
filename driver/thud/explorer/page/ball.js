// The ball on the floor at one instant, and its animation.
import { byId, rounded } from "./page.js";

// Duration of the animation, ms, and how far a floor is shown to move at most, as part of the ball.
const DURATION = 4000;
const REACH = 0.12;
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
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const last = motion.time.length - 1;
  const i = Math.round(Number(byId("instant").value) * last);
  const top = motion.outer ? Math.max(...motion.outer.flat().map(([, z]) => z)) : 2 * motion.radius;
  const times = magnification(top);
  const ground = canvas.height - 70;
  const scale = (ground - 20) / Math.max(200, top);
  const x = (r) => canvas.width / 2 + scale * r;
  const y = (z) => ground - scale * (z - times * motion.floor[i]);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.lineWidth = 2;
  context.fillStyle = colour("--floor");
  context.fillRect(0, y(0), canvas.width, canvas.height);
  context.strokeStyle = colour("--quiet");
  context.beginPath();
  context.moveTo(0, y(0));
  context.lineTo(canvas.width, y(0));
  context.stroke();
  context.fillStyle = colour("--rubber");
  context.strokeStyle = colour("--ink");
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
  byId("instant_words").textContent = time;
  byId("instant").setAttribute("aria-valuetext", time);
  const shape = motion.outer ? "Computed section." : "Shape that the model assumes: a sphere, flattened by its deflection.";
  const moved = times > 1 ? ` The floor moves by up to ${rounded(Math.max(...motion.floor), "mm")}, magnified ${times}×.` : "";
  byId("ball_words").textContent = shape + moved;
}

/** Return by what round number the motion of the floor is enlarged. */
function magnification(top) {
  const most = Math.max(...motion.floor);
  if (!(most > 0)) return 1;
  const free = (REACH * top) / most;
  const power = 10 ** Math.floor(Math.log10(free));
  return Math.max(1, power * [5, 2, 1].find((factor) => factor * power <= free));
}

/** Return the surfaces of a sphere whose lower part, and the wall on it, lies flat on the floor. */
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
  const on = !playing;
  byId("play").textContent = on ? "Pause" : "Play";
  cancelAnimationFrame(playing);
  playing = 0;
  if (!on) return;
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
