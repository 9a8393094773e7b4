"""How to cite: BibTeX of the collection, families and problems, and of solvers and their papers.

references.bib has the papers, each by its first author and its year, as solvers name them:
"Alart & Curnier 1991; Acary, Bremond & Huber 2018" is alart1991 and acary2018. An entry has a DOI
only if a second source gives it for that paper: a page without a link is better than a wrong one.
"""

from __future__ import annotations

import functools
import hashlib
import re
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fclib import _core
from fclib.bench.plots import latex_text
from fclib.collections.set_index import SETS

REFERENCES = Path(__file__).with_name("references.bib")
REPORT = """\
@techreport{fclib2014,
  author = {Acary, Vincent and Br{\\'e}mond, Maurice and Koziara, Tomasz and P{\\'e}rignon, Franck},
  title = {{FCLIB}: a collection of discrete {3D} Frictional Contact problems},
  institution = {Inria},
  type = {Technical report},
  number = {RT-0444},
  year = {2014},
  url = {https://hal.inria.fr/hal-00945820}
}"""
SOFTWARE = """\
@software{{fclib,
  author = {{{{The FCLIB developers}}}},
  title = {{{{FCLIB}}: discrete frictional contact problems, and a test bench for their solvers}},
  version = {{{version}}}
}}"""


def references() -> Mapping[str, str]:
    """The papers, by their keys."""
    return _read(REFERENCES.read_text(encoding="utf-8"))


@functools.cache
def _read(text: str) -> Mapping[str, str]:
    entries = re.split(r"\n\n(?=@)", text.strip())
    return {entry.partition("{")[2].partition(",")[0]: entry for entry in entries}


def keys_of(citation: str) -> list[str]:
    """The keys of the papers that a solver names; an entry without a year is not a paper."""
    found = []
    for part in citation.split(";"):
        year = re.search(r"\b(1[89]|20)\d\d\b", part)
        if year is None:
            continue
        first = re.split(r",| & | et al| \d", part.strip())[0]
        plain = unicodedata.normalize("NFKD", first).encode("ascii", "ignore").decode()
        key = re.sub("[^a-z]", "", plain.lower()) + year[0]
        # the paper appeared a year after its report
        found.append({"fukushima2002": "fukushima2001"}.get(key, key))
    return found


def papers_of(citation: str) -> list[dict[str, str]]:
    """BibTeX and DOI of the papers that a solver names."""
    known = references()
    found = []
    for key in keys_of(citation):
        if key in known:
            doi = re.search(r"doi = \{([^}]*)\}", known[key])
            title = re.search(r"title = \{(.*)\},?\n", known[key])
            found.append(
                {
                    "key": key,
                    "bibtex": known[key],
                    "title": re.sub(r"[{}]", "", title[1]) if title else key,
                    "doi": doi[1] if doi else "",
                }
            )
    return found


def of_solver(name: str, title: str, citation: str, origin: str, version: str) -> list[str]:
    """What to cite of a solver: its papers; itself if it has none or is of another package."""
    papers = [paper["bibtex"] for paper in papers_of(citation)]
    if papers and origin == "fclib":
        return papers
    return [*papers, implementation(name, title, f"{origin} {version}".strip())]


def software() -> str:
    """BibTeX of this software, from CITATION.cff."""
    return SOFTWARE.format(version=_core.version)


def collection() -> str:
    """BibTeX of the collection: the report that began it, and the software that has it."""
    return f"{REPORT}\n\n{software()}"


def family(record: Mapping[str, Any]) -> str:
    """BibTeX of a family."""
    name = f"{record['set']}/{record['name']}" if record.get("set") else record["name"]
    note = [f"set {record['set']}"] if record.get("set") else []
    note += [f"version {record['version']}"] if record.get("version") else []
    note += [f"original by {record['authors']}"] if record.get("authors") else []
    note += [f"FCLIB {_core.version}"]
    return entry("family", name, f"{record.get('title') or name}: problems of {name}", note)


def set_of_problems(name: str) -> str:
    """BibTeX of a set, in its present version."""
    version, words = SETS[name]
    return entry("set", name, f"{name}: {words}", [f"version {version}", f"FCLIB {_core.version}"])


def problem() -> str:
    """BibTeX of a problem, with {id}, {key}, {version} and {digest} to fill in."""
    note = ["version {version}", "fclib.digest {digest}", f"FCLIB {_core.version}"]
    return _entry("problem-{key}", "Frictional contact problem {id}", note)


def implementation(name: str, title: str, version: str) -> str:
    """BibTeX of a solver: of its version here, or of its origin."""
    note = version or f"FCLIB {_core.version}"
    return entry("solver", name, f"{title or name}: solver {name}", [note])


def entry(kind: str, name: str, title: str, note: Sequence[str]) -> str:
    """An entry of BibTeX by the developers, of plain texts."""
    return _entry(f"{kind}-{key_for(name)}", latex_text(title), [latex_text(part) for part in note])


def key_for(name: str) -> str:
    r"""A name as a key of BibTeX, which \cite takes too: ASCII letters, digits, - and _."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    key = re.sub(r"[^A-Za-z0-9_-]+", "-", plain)
    if re.fullmatch(r"[A-Za-z0-9_/ -]+", name):
        return key
    # names that differ in other characters alone have different keys
    return f"{key}-{hashlib.sha256(name.encode()).hexdigest()[:6]}"


def key_of(entry: str) -> str:
    """The key of an entry of BibTeX."""
    return entry.partition("{")[2].partition(",")[0].strip()


def distinct(lists: Sequence[Sequence[str]]) -> list[list[str]]:
    """Lists of entries in which no two different ones have the same key.

    Two versions of one solver are two entries; the key of the second then ends in -2.
    """
    known: dict[str, str] = {}  # by the entry as it was given
    taken: set[str] = set()
    for entry in (one for entries in lists for one in entries):
        if entry in known:
            continue
        key = own = key_of(entry)
        count = 1
        while own in taken:
            count += 1
            own = f"{key}-{count}"
        taken.add(own)
        known[entry] = entry.replace(key, own, 1)
    return [[known[entry] for entry in entries] for entries in lists]


def _entry(key: str, title: str, note: Sequence[str]) -> str:
    return (
        f"@misc{{fclib-{key},\n"
        "  author = {{The FCLIB developers}},\n"
        f"  title = {{{title}}},\n"
        f"  note = {{{', '.join(note)}}}\n"
        "}"
    )
