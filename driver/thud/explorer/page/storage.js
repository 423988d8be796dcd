// Storage of the browser; where it is denied or full, this page keeps the texts for itself.
const CASE = "explorer";
const AREAS = ["sessionStorage", "localStorage"];
const unstored = new Map();

/** Return a stored text, or null; that of this tab comes before that of the browser. */
export function stored(name) {
  if (unstored.has(name)) return unstored.get(name);
  for (const area of AREAS) {
    try {
      const text = window[area].getItem(name);
      if (text !== null) return text;
    } catch { /* Storage is denied. */ }
  }
  return null;
}

/** Store a text, and return whether that was possible. */
export function storeText(name, text, area = "localStorage") {
  unstored.set(name, text);
  try {
    window[area].setItem(name, text);
    unstored.delete(name);
    return true;
  } catch {
    return false;
  }
}

/** Return the case of this tab, or else the last one of this browser; null if there is none. */
export function storedCase() {
  try { return JSON.parse(stored(CASE)); } catch { return null; }
}

/** Store the first of the contents for which there is room, for this tab and for others. */
export function storeCase(...contents) {
  for (const area of AREAS) contents.some((content) => storeText(CASE, JSON.stringify(content), area));
}
