// The site's search by words: pages that say all of them come first, then those that say some; a word that no page
// says stands for the words that are spelled nearly like it. Rare words count more than frequent ones, and
// headings that say little else lead to their section.
if (typeof Search !== "undefined") {
  const listed = (files) => (files === undefined ? [] : [].concat(files));

  // Changes of a letter, two letters in turn included, that make one word of the other; 3 for more than 2.
  const distance = (a, b) => {
    if (Math.abs(a.length - b.length) > 2) return 3;
    const rows = [[...Array(b.length + 1).keys()]];
    for (let i = 1; i <= a.length; i++) {
      rows.push([i]);
      for (let j = 1; j <= b.length; j++) {
        const same = a[i - 1] === b[j - 1] ? 0 : 1;
        let least = Math.min(rows[i - 1][j] + 1, rows[i][j - 1] + 1, rows[i - 1][j - 1] + same);
        if (i > 1 && j > 1 && a[i - 1] === b[j - 2] && a[i - 2] === b[j - 1])
          least = Math.min(least, rows[i - 2][j - 2] + 1);
        rows[i].push(least);
      }
    }
    return Math.min(rows[a.length][b.length], 3);
  };

  // What a page gets for a word: in a heading or in the text, as it is, as a part, or nearly so.
  const known = new Map();
  const scores = (word) => {
    if (known.has(word)) return known.get(word);
    const found = new Map();
    known.set(word, found);
    const raise = (files, score) =>
      listed(files).forEach((file) => found.set(file, Math.max(found.get(file) ?? 0, score)));
    const places = [[Search._index.titleterms, 1], [Search._index.terms, 1 / 3]];
    for (const [terms, part] of places)
      for (const term of Object.keys(terms))
        if (term === word) raise(terms[term], part);
        else if (word.length > 2 && term.startsWith(word)) raise(terms[term], part / 2);
    const most = word.length > 6 ? 2 : 1;
    if (found.size === 0 && word.length > 3)
      for (const [terms, part] of places)
        for (const term of Object.keys(terms))
          if (distance(term, word) <= most) raise(terms[term], part / 4);
    return found;
  };

  Search.performTermsSearch = (wanted, excluded) => {
    const { alltitles, docnames, filenames, titles } = Search._index;
    const without = new Set([...excluded].flatMap((word) => [...scores(word).keys()]));
    const rare = (word) => Math.log(1 + docnames.length / Math.max(scores(word).size, 1));
    const totals = new Map();
    const counts = new Map();
    for (const word of wanted) {
      for (const [file, score] of scores(word)) {
        totals.set(file, (totals.get(file) ?? 0) + 10 * rare(word) * score);
        counts.set(file, (counts.get(file) ?? 0) + 1);
      }
    }
    const said = (file) => (counts.get(file) / wanted.size) ** 2;
    const stemmer = new Stemmer();
    const asked = (new URLSearchParams(window.location.search).get("q") ?? "").trim().toLowerCase();
    const sections = [];
    for (const [title, places] of Object.entries(alltitles)) {
      const parts = splitQuery(title.toLowerCase()).filter((word) => !stopwords.has(word));
      const words = new Set(parts.map((word) => stemmer.stemWord(word)));
      if (wanted.size === 0 || ![...wanted].every((word) => words.has(word))) continue;
      const sum = (all) => [...all].reduce((total, word) => total + rare(word), 0);
      // A heading with all of it counts more: of "after effects" only "effects" is a word to be looked up.
      const whole = asked.includes(" ") && title.toLowerCase().includes(asked) ? 40 : 0;
      const score = 10 * sum(wanted) * (1 + sum(wanted) / sum(words)) + whole;
      for (const [file, id] of places)
        sections.push([
          docnames[file], titles[file] === title ? title : `${titles[file]} > ${title}`,
          id === null ? "" : "#" + id, null, score, filenames[file], SearchResultKind.title,
        ]);
    }
    const pages = [...totals]
      .filter(([file]) => !without.has(file))
      .map(([file, score]) => [
        docnames[file], titles[file], "", null, score * said(file), filenames[file], SearchResultKind.text,
      ]);
    return [...pages, ...sections];
  };
}
