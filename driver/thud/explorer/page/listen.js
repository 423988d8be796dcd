// Sound in the room below: a button for each variant with a room, and a player.
import { button, byId } from "thud/page.js";
import { swatch } from "thud/plot.js";
import { fileOf } from "thud/files.js";

const NOTE = "Computed, not recorded: no measured room, no furniture, no listener's head; 50 to 630 Hz. The levels of all variants have the same scale: set the volume for the loudest.";
// Address and full scale, Pa, of each downloaded sound by the text of its case.
const sounds = new Map();

/** Show the buttons of the variants with a room. */
export function showSounds(variants, onError) {
  const rooms = variants.filter((variant) => variant.answer.room && variant.values);
  byId("sound_section").hidden = !rooms.length;
  byId("sounds_text").textContent = NOTE;
  byId("sounds").replaceChildren(...rooms.map((variant) => {
    const result = button("", () => playSound(variant, rooms).catch(onError));
    result.append(swatch(variant.style), ` Listen to ${variant.label}`);
    return result;
  }));
}

const caseOf = (variant) => JSON.stringify(variant.values);

async function playSound(variant, rooms) {
  byId("sounds_text").textContent = "Computing the sound …";
  try {
    // All sounds, since the loudest one determines the volume of the others.
    await Promise.all(rooms.map(loadSound));
  } finally {
    byId("sounds_text").textContent = NOTE;
  }
  const scales = rooms.map((room) => sounds.get(caseOf(room)).fullScale);
  const sound = sounds.get(caseOf(variant));
  const player = byId("player");
  player.hidden = false;
  player.src = sound.address;
  player.volume = sound.fullScale / Math.max(...scales);
  // A browser may refuse to play long after the click; the player has a button of its own.
  player.play().catch(() => {});
}

async function loadSound(variant) {
  const text = caseOf(variant);
  if (sounds.has(text)) return;
  const { wav, full_scale: fullScale } = await fileOf("room.wav", variant.values);
  const content = Uint8Array.from(atob(wav), (letter) => letter.charCodeAt(0));
  sounds.set(text, { address: URL.createObjectURL(new Blob([content], { type: "audio/wav" })), fullScale });
}
