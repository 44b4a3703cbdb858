// What a search finds, in this order: chapters, names of the package, pages of the reference and of what changed.
var Scorer = {
  score: ([page, title, anchor, kind, score]) => score - (kind === null && /^(book\/api\/|CHANGELOG)/.test(page) ? 4 : 0),
  objNameMatch: 1,
  objPartialMatch: 0,
  objPrio: { 0: 3, 1: 3, 2: 3 },
  objPrioDefault: 3,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
