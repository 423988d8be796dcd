// How the search orders what it finds: pages of the guide before those of single names, and of pages
// with a word in their text those of keys and terms first. The other numbers are those of Sphinx.
var Scorer = {
  score: ([page, , , , score]) =>
    score + (page.startsWith("docs/") ? 20 : 0) + (/^docs\/(keys|glossary)$/.test(page) ? 1 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
