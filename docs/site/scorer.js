// Guides before the reference, and both before what is for those who change the code.
const PLACES = [
  [/^(changelog|contributing|internals\/)/, -40],
  [/^(reference|notebooks)\//, 0],
  [/./, 12],
];

var Scorer = {
  score: ([page, title, anchor, about, score]) =>
    score + PLACES.find(([place]) => place.test(page))[1],
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
