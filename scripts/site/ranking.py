"""The order of what the search finds: a heading of these words, the page that defines them, then
those that use them most.

Sphinx's own index knows whether a page has a word, not how often. A table of the pages that use a
word most goes with the script that Sphinx asks for the score of a result.
"""

from __future__ import annotations

import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping

WORD = re.compile(r"[a-zé]{3,}")
GLOSSARY = "glossary"
MOST = 5  # pages of a word
ROW = re.compile(r"^\|([^|]+)\|[^|]*\|[^|]*\|([^|]*)\|", re.MULTILINE)
SCRIPT = """\
// the score of what is found, by tables of scripts/site/ranking.py
"use strict";
const DEFINED = %(defined)s; // words of the glossary's terms
const USED = %(used)s; // the pages that use a word most
const asked = (new URLSearchParams(location.search).get("q") || "").toLowerCase();
const words = asked.match(/[a-zé]{3,}/g) || [];
const has = (term) => words.length && words.every((word) => term.includes(word));
const isDefined = DEFINED.some(has);
// a browser gives a page no text of other files
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
var Scorer = {
  score: ([page, title, , , score]) => {
    if (title.toLowerCase().split(" > ").pop() === asked) return score + 2000;
    if (isDefined && page === "%(glossary)s") return score + 1000;
    const places = words.map((word) => (USED[word] || []).indexOf(page));
    return score + places.reduce((sum, k) => sum + (k < 0 ? 0 : 20 * (%(most)d - k)), 0);
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
"""


def defined(glossary: str) -> list[list[str]]:
    """Of each term of the glossary its words, and the words of its name in the code."""
    rows = [WORD.findall(" ".join(row).lower()) for row in ROW.findall(glossary)]
    return [words for words in rows if words]


def used(texts: Mapping[str, str]) -> dict[str, list[str]]:
    """Of each word the pages that use it most, the most first; for their length, if as often."""
    counts: dict[str, list[tuple[int, int, str]]] = defaultdict(list)
    for page, text in texts.items():
        for word, count in Counter(WORD.findall(text.lower())).items():
            counts[word].append((-count, len(text), page))
    several = {word: sorted(own) for word, own in counts.items() if len(own) > 1}
    return {word: [page for *_, page in own[:MOST]] for word, own in several.items()}


def script(pages: Iterable[tuple[str, str]]) -> str:
    """The script for Sphinx, of all pages: name and text."""
    texts = dict(pages)

    def packed(value: object) -> str:
        return json.dumps(value, ensure_ascii=False, separators=(",", ":"))

    return SCRIPT % {
        "defined": packed(defined(texts[GLOSSARY])),
        "used": packed(used(texts)),
        "glossary": GLOSSARY,
        "most": MOST,
    }
