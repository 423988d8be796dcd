// Steps of undo, and what the browser stores.
import { byId } from "thud/page.js";
import { storeCase, storedCase } from "thud/storage.js";
import { about, state } from "thud/form.js";
import { recording } from "thud/recording.js";
import { current, isCurrent, kept } from "thud/answers.js";

// Pause after a change before it can be undone, ms.
const COMMIT_PAUSE = 400;

const steps = { list: [], at: -1, timer: 0 };
const snapshot = () => ({ state: JSON.stringify(state), kept: kept.list, recorded: current.recording, files: recording.files });

export function commitSoon() {
  clearTimeout(steps.timer);
  steps.timer = setTimeout(commit, COMMIT_PAUSE);
}

/** Remember the case and its variants, so that a change can be undone. */
export function commit() {
  clearTimeout(steps.timer);
  const [last, next] = [steps.list[steps.at], snapshot()];
  const isEqual = last && last.kept === next.kept && last.files === next.files && sameCase(last.state, next.state);
  store();
  if (isEqual) { last.recorded = current.recording; return; }
  steps.list.splice(steps.at + 1, Infinity, next);
  steps.at = steps.list.length - 1;
  showSteps();
}

function sameCase(one, other) {
  const text = (entry) => JSON.stringify({ ...JSON.parse(entry), door: null, view: null });
  return text(one) === text(other);
}

function showSteps() {
  const [undo, redo] = [byId("undo"), byId("redo")];
  const focused = [undo, redo].find((target) => target === document.activeElement);
  undo.disabled = steps.at <= 0;
  redo.disabled = steps.at >= steps.list.length - 1;
  // A button that is disabled loses the focus.
  if (focused) [focused, undo, redo].find(({ disabled }) => !disabled)?.focus();
}

/** Take over the values of another step; return whether there is one. */
export function takeStep(count) {
  commit();
  const step = steps.list[steps.at + count];
  if (!step) return false;
  steps.at += count;
  restore({ ...JSON.parse(step.state), view: state.view });
  kept.list = step.kept;
  current.recording = step.recorded;
  recording.files = step.files;
  showSteps();
  store();
  return true;
}

function restore(values) {
  for (const name of Object.keys(state)) state[name] = values[name] ?? state[name];
}

const withoutMotion = (variant) => ({ ...variant, answer: { ...variant.answer, motion: null } });

/** Store case and variants in this browser; without room for the answers, only the case. */
function store() {
  const own = current[state.door];
  const entry = { start: JSON.stringify(about.start), state, shown: own?.values && isCurrent(state.door) ? withoutMotion(own) : null, kept: kept.list.map(withoutMotion) };
  storeCase(entry, { ...entry, shown: null, kept: [] });
}

/** Restore what this browser has stored for the same start; return whether there was something. */
export function restoreStored() {
  const entry = storedCase();
  if (entry?.start !== JSON.stringify(about.start) || !about.models.some(({ name }) => name === entry.state?.model)) return false;
  restore(entry.state);
  kept.list = entry.kept;
  return true;
}
