// First picture: the answer that the page contains or has stored, until the rest has arrived.
import { byId } from "thud/page.js";
import { fragment } from "thud/request.js";
import { showAnswer } from "thud/results.js";
import { stored, storedCase } from "thud/storage.js";

/** Variant with which the page begins, without motion; null if it has to be computed. */
export const firstVariant = findFirst();

function findFirst() {
  // Empty if the command names a case, which this page must not show without its token.
  const content = JSON.parse(byId("first_answer").textContent || "null");
  if (!content || fragment.has("case") || !stored("token")) return null;
  const own = storedCase();
  const variant = own ? own.start === "{}" && own.shown : { door: "ball", style: 0, label: "Standard ball", ...content };
  const isOther = fragment.has("door") && fragment.get("door") !== variant?.door;
  return variant && !isOther ? { ...variant, isPartial: true } : null;
}

if (firstVariant) {
  document.body.dataset.door = firstVariant.door;
  showAnswer([firstVariant], {});
}
