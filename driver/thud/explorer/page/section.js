// Section of the floor with the source above it and the room below, and the ratings of the room.
import { byId, element, fillTable, minus, rounded, svgElement, withSymbols } from "thud/page.js";
import { nameOf } from "thud/results.js";

// Width of the drawn floor, height above it besides the ball, of the room, and of a number beside
// a layer, px; largest height of the floor, px, and its scale, px per m, if it is thinner.
const [WIDTH, FALL, ROOM, NUMBER] = [230, 44, 92, 16];
const [MAX_HEIGHT, SCALE] = [240, 290];

/** Show the section of an answer; hide it if there is none. */
export function showSection({ section, room }) {
  byId("section_section").hidden = !section;
  if (!section) return;
  // Units do not part from their numbers.
  const names = section.layers.map(({ name, thickness }) => `${millimeters(thickness)} ${name}`.replace(/(\d) (?=\D)/g, "$1\u00a0"));
  const list = element("ol", {}, ...names.map((text) => element("li", {}, text)));
  byId("section").replaceChildren(draw(section, room?.size, names), list);
}

// A density of 0 is not known, kg/m³.
const isAir = ({ density }) => density > 0 && density < 2;
const millimeters = (length) => rounded(1000 * length, "mm");

function draw({ radius, height, layers }, size, names) {
  const total = layers.reduce((sum, { thickness }) => sum + thickness, 0);
  const scale = Math.min(SCALE, MAX_HEIGHT / total);
  const top = 2 * radius * scale + FALL + 4;
  const bottom = top + total * scale;
  const sides = size ? [size.length, size.width, size.height] : [];
  const texts = size ? [sides.every(Boolean) ? `${sides.map((side) => rounded(side)).join(" × ")} m` : "",
    rounded(size.volume, "m³"), `reverberation time ${rounded(size.reverberation_time, "s")}`].filter(Boolean) : [];
  const words = `Dropped from ${rounded(height, "m")} on ${names.join(", ")}`;
  const image = svgElement("svg", {
    width: WIDTH + 40, height: bottom + (size ? ROOM : 0) + 8, role: "img",
    "aria-label": size ? `${words}; room below: ${texts.join(", ")}` : words,
  });
  const middle = WIDTH / 2;
  image.append(
    svgElement("circle", { class: "source", cx: middle, cy: radius * scale + 2, r: radius * scale }),
    svgElement("path", { class: "leader", d: `M${middle} ${top - FALL}V${top}m-4 -8l4 8l4 -8` }),
    svgElement("text", { x: middle + 10, y: top - FALL / 2 + 4 }, rounded(height, "m")));
  // Numbers stand beside their layers, but not closer to each other than their height.
  let [at, last] = [top, top - NUMBER];
  layers.forEach((layer, i) => {
    const thickness = layer.thickness * scale;
    for (const [x, width] of members(layer, scale)) image.append(svgElement("rect",
      { class: isAir(layer) ? "layer air" : `layer tone${i % 2}`, x, y: at, width, height: thickness }));
    const y = Math.max(at + thickness / 2, last + NUMBER);
    image.append(
      svgElement("path", { class: "leader", d: `M${WIDTH} ${at + thickness / 2}L${WIDTH + 18} ${y}` }),
      svgElement("text", { x: WIDTH + 22, y: y + 4 }, String(i + 1)));
    [at, last] = [at + thickness, y];
  });
  if (!size) return image;
  image.append(svgElement("path", { class: "wall", d: `M1 ${bottom}v${ROOM}H${WIDTH - 1}v${-ROOM}` }));
  texts.forEach((text, i) => image.append(svgElement("text",
    { x: middle, y: bottom + ROOM / 2 + 18 * (i - 1) + 4, "text-anchor": "middle" }, text)));
  return image;
}

/** Return position and width of the members of a layer, px: of joists, or all of it. */
function members({ width, spacing }, scale) {
  if (!spacing) return [[0, WIDTH]];
  const result = [];
  for (let x = WIDTH / 4 % (spacing * scale); x < WIDTH; x += spacing * scale) {
    const [left, right] = [Math.max(0, x - width * scale / 2), Math.min(WIDTH, x + width * scale / 2)];
    result.push([left, right - left]);
  }
  return result;
}

/** Show the ratings of variants, and the levels of the octaves. */
export function showRatings(variants) {
  const rooms = variants.filter(({ answer }) => answer.room);
  byId("ratings_section").hidden = !variants[0].answer.room;
  if (!rooms.length) return;
  const level = (value) => minus(value.toFixed(1));
  const row = (name, cellOf) => [withSymbols(name), ...rooms.map(({ answer: { room } }) => cellOf(room))];
  const { ratings: names, octaves: bands } = rooms[0].answer.room;
  const heads = rooms.map((variant) => nameOf(rooms, variant, "Level ± standard uncertainty"));
  fillTable("ratings", ["Rating, dB", ...heads], [
    ...names.map(([name], i) => row(name, ({ ratings }) =>
      ratings[i].slice(1).map(level).join(" ± "))),
    ...(rooms.some(({ answer }) => answer.room.class)
      ? [row("Class (KS F 2863-2)", (room) => room.class || "–")] : []),
    ...bands.map(([band], i) => row(`Octave of ${band} Hz`, ({ octaves }) => level(octaves[i][1]))),
  ]);
}
