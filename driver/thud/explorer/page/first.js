// First picture: the answer that the page itself contains, until the rest has arrived.
import { byId } from "./page.js";
import { fragment } from "./request.js";
import { showCriteria, showForces, showHeadline } from "./results.js";

/** Values and answer of the case with which the page begins, or null. */
export const firstAnswer = JSON.parse(byId("first_answer").textContent || "null");
export const STORE = "explorer";

// Not if a link or an earlier visit holds another case.
if (firstAnswer && !fragment.size && !localStorage.getItem(STORE)) {
  const variant = { label: "Standard ball", style: 0, answer: firstAnswer.answer };
  showHeadline(variant);
  showForces([variant], {});
  showCriteria([variant]);
}
