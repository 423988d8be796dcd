// Headlines of answers in words: the verdict on a source, or the level in a room.

/** Verdicts by their codes. */
export const VERDICTS = {
  conforms: "conforms", does_not_conform: "does not conform", undecided: "undecided",
};
// Maximum number of criteria with values in a headline.
const MAX_NAMED = 2;

/** Return the code of the result that an answer is about: of its room if it has one. */
export const resultOf = ({ result, room }) => room?.result ?? result;

/** Return words, reason, what narrow screens omit, and details of an answer. */
export function headlineOf(answer) {
  return answer.room ? roomHeadline(answer.room) : sourceHeadline(answer);
}

/** Return the headline of an answer as a text. */
export function headlineText(answer) {
  const { words, why, also } = headlineOf(answer);
  return `${words}${why}${also}`;
}

function roomHeadline({ result, rounded, uncertainty_of_rating: uncertainty, chance, detail }) {
  const level = `${rounded} dB`;
  const why = [`, standard uncertainty ${uncertainty.toFixed(1)} dB`, chance].filter(Boolean);
  return {
    words: VERDICTS[result] ? `${VERDICTS[result]}: ${level}` : level,
    why: why.join("; "), also: "", detail,
  };
}

function sourceHeadline({ result, criteria, limits, drops, largest, excluded }) {
  const isModel = drops === undefined;
  const open = result === "conforms" ? [] : criteria.filter((entry) => entry.result === result);
  const known = open.filter(({ value }) => value !== null);
  const namesOf = (entries) => entries.map(({ name }) => name).join(", ");
  const parts = known.slice(0, MAX_NAMED).map(causeOf);
  const also = known.length > MAX_NAMED ? [`also ${namesOf(known.slice(MAX_NAMED))}`] : [];
  const unknown = namesOf(open.filter(({ value }) => value === null));
  if (unknown) (also.length ? also : parts).push(`not known: ${unknown}`);
  const details = [
    result === "conforms" && closest(criteria),
    isModel && "Values of this model only, from which others may differ.",
    result === "undecided" && largest?.length
      && `Largest contribution to the uncertainty of ${largest.join(": ")}.`,
    excluded, `Limits of the ${limits.source}: ${limits.standard}.`,
    limits.assumed && "The source is not stated: these limits are assumed.",
  ];
  return {
    words: `${VERDICTS[result]}${isModel ? " by this model" : ""}`,
    why: parts.length ? `: ${parts.join("; ")}` : "", also: also.map((text) => `; ${text}`).join(""),
    detail: details.filter(Boolean).join(" "),
  };
}

/** Return the distance of a value from the nearer limit, negative outside. */
export const marginOf = ({ value, lower, upper }) => Math.min(value - lower, upper - value);

/** Return the level that is closest to one of its limits, and its distance. */
function closest(criteria) {
  const levels = criteria.filter(({ unit }) => unit === "dB");
  const first = levels.reduce((one, other) => (marginOf(other) < marginOf(one) ? other : one));
  return `Closest to a limit: ${first.name}, ${marginOf(first).toFixed(2)} dB.`;
}

/** Return the uncertainty of a criterion behind a sign, with the mark of an incomplete one. */
export const uncertaintyText = ({ uncertainty_text: text, mark }) => `± ${text} ${mark}`.trim();

/** Return name, value and limit of a criterion that is not met or not decided. */
function causeOf(criterion) {
  const { name, unit, value, value_text: text, uncertainty, lower, upper } = criterion;
  const withUnit = (shown) => `${name} ${shown} ${unit}`.trim();
  if (criterion.result === "does_not_conform") {
    const isMeasured = uncertainty && criterion.uncertainty_kind === "measured";
    const shown = isMeasured ? `${text} ${uncertaintyText(criterion)}` : text;
    return `${withUnit(shown)}, ${value < lower ? `below ${lower}` : `above ${upper}`}`;
  }
  if (criterion.not_stated.length)
    return `${withUnit(text)}, uncertainty of ${criterion.not_stated.join(" and ")} not stated`;
  if (!uncertainty) return `${withUnit(text)}, uncertainty not known`;
  const decimals = text.split(".")[1]?.length ?? 0;
  const ends = [value - uncertainty, value + uncertainty].map((end) => end.toFixed(decimals));
  return `${withUnit(ends.join(" to "))}, limits ${limitsText(criterion)}`;
}

/** Return the limits of a criterion. */
export const limitsText = ({ lower, upper }) => [...new Set([lower, upper])].join(" to ");
