// How the search orders what it finds: pages of the guide before those of single names, pages and
// sections with all words in their title before others, and of those with the words in their text
// keys and terms first. The other numbers are those of Sphinx.
const WORDS = (new URLSearchParams(location.search).get("q") ?? "").toLowerCase().split(/\s+/);
var Scorer = {
  score: ([page, title, , , score]) =>
    score +
    (page.startsWith("docs/") ? 20 : 0) +
    (WORDS.every((word) => title.toLowerCase().includes(word)) ? 10 : 0) +
    (/^docs\/(keys|glossary)$/.test(page) ? 1 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
