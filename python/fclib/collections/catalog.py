"""The catalogue: a row for each problem, in a file catalog.parquet beside the problems.

It holds nothing that depends on the machine or the hour: two builds give equal catalogues.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib
import json
import operator
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from fclib import _core
from fclib._files import replace_file
from fclib._regular import reason_of, regular
from fclib._suggest import suggestion

FILE = "catalog.parquet"
PROVEN = "infeasible"  # the status of a solve that has proved that there is no solution
# folder of a family while it is built: a checkpoint, and in it the rows made so far
STATE = ".state"
KEPT = "kept.json"
# key in a family's own part: the plan that built it, as JSON
FINGERPRINT = b"fclib.plan"

# column, type of Arrow, meaning
COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("id", "string", "SET/FAMILY/NUMBER"),
    ("collection", "string", "the set"),
    ("version", "string", "of the set"),
    ("family", "string", "the scene's family, or the name of its MJCF file"),
    ("number", "int32", "counts the steps that have a contact, or the family's problems"),
    ("step", "int32", "of the simulation; the number if there is none"),
    ("time", "float64", "at the start of the step [s]; null without a simulation"),
    ("seed", "int64", "of the scene; null for an MJCF file"),
    ("title", "string", "of the problem"),
    ("formulation", "string", "of the global form, or the only one, in RT-0444's abbreviations"),
    ("law", "string", "of friction: Coulomb, rolling, spin, or none if mu is 0"),
    ("spacedim", "int32", "components of a contact"),
    ("n", "int32", "degrees of freedom of the bodies that contacts move; 0 for a local problem"),
    ("p", "int32", "bilateral constraints"),
    ("nc", "int32", "contacts"),
    ("h", "float64", "time step [s]; null if nobody said"),
    ("theta", "float64", "of the Moreau-Jean scheme; null for other schemes"),
    ("restitution", "float64", "coefficient of Newton's impact law; null if nobody said"),
    ("scheme", "string", "time stepping and law of contact: Moreau-Jean, velocity or gap"),
    ("engine", "string", "programs that made the data, with their versions"),
    ("elastic", "bool", "whether the bodies deform; null if nobody said"),
    ("bodies", "int32", "bodies, or trees of bodies, among which the contacts are, if simulated"),
    ("density", "float64", "spacedim nc / n, contact components for a degree of freedom"),
    ("mu_min", "float64", "smallest coefficient of friction"),
    ("mu_max", "float64", "largest coefficient of friction"),
    ("nnz_M", "int64", "entries of M"),
    ("nnz_H", "int64", "entries of H"),
    ("nnz_W", "int64", "entries of W"),
    ("open", "int32", "contacts without reaction in the best solution known"),
    ("stick", "int32", "sticking contacts in the best solution known"),
    ("slide", "int32", "sliding contacts in the best solution known"),
    ("solver", "string", "that found it"),
    ("status", "string", "what it said"),
    ("tol", "float64", "what it was asked for"),
    ("error", "float64", "of it, by both natural maps, relative; of the global form"),
    (
        "has_solution",
        "bool",
        "whether that is a solution, and stored as one; null: none was looked for",
    ),
    ("trivial", "string", "why r = 0 solves it; null: it does not, or nobody tried"),
    ("nsgs_sweeps", "int32", "that NSGS takes to 1e-6; null if the hard ones were not selected"),
    ("rating", "string", "easy, hard or open, by stored runs; null: the problem was not run"),
    ("left_out", "string", "what the scene asked for and no problem holds; null: nothing"),
    ("digest", "string", "fclib.digest of the global form, or the only one"),
    ("same_as", "string", "the first problem of this catalogue with the same data; null: itself"),
    ("global_file", "string", "path from the catalogue's folder"),
    ("global_sha256", "string", "of that file"),
    ("local_file", "string", "path from the catalogue's folder"),
    ("local_sha256", "string", "of that file"),
    ("license", "string", "of the data; null if nobody said"),
    ("citation", "string", "how to name the data; null if nobody said"),
)

# columns of the files' paths and SHA-256
FILES = ("global_file", "global_sha256", "local_file", "local_sha256")

# columns that become parts of paths
FOLDERS = ("collection", "family", "global_file", "local_file")

# further columns; a build fills the cheap ones, or all of them if it is asked to analyze;
# docs/analysis.md has their meaning
ANALYSIS: tuple[str, ...] = (
    "islands",
    "largest_island",
    "asymmetry_W",
    "definiteness",
    "rank_H",
    "conditioning_H",
    "rank_W",
    "conditioning_W",
    "hyperstaticity",
    "mass_ratio",
    "prestress",
    "slater",
    "existence",
    "uniqueness",
    "reactions_unique",
)


class CatalogError(_core.Error):
    """A catalogue is missing, or is not one."""


class ConditionError(_core.Error, ValueError):
    """A condition on the rows of a catalogue cannot be understood."""


def arrow() -> Any:
    """The module pyarrow. Without it an ImportError says what to install."""
    try:
        importlib.import_module("pyarrow.parquet")
        return importlib.import_module("pyarrow")
    except ImportError as error:
        raise ImportError(
            f"the catalogue needs pyarrow ({error});"
            " install it with: pip install 'fclib[collection]'"
        ) from error


def write_catalog(
    path: Path, records: Iterable[Mapping[str, Any]], metadata: Mapping[bytes, bytes] | None = None
) -> None:
    """Write the rows, in the order of their identifiers; the file is whole, or the old one."""
    pa = arrow()
    schema = pa.schema(
        [
            pa.field(name, pa.type_for_alias(kind), metadata={"doc": doc})
            for name, kind, doc in COLUMNS
        ],
        metadata=dict(metadata or {}),
    )
    extra = sorted({key for row in records for key in row} - {name for name, *_ in COLUMNS})
    rows = with_copies(sorted(records, key=lambda row: str(row["id"])))
    for key in extra:
        values = pa.array([row.get(key) for row in rows])
        schema = schema.append(pa.field(key, values.type))
    table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
    replace_file(path, lambda target: pa.parquet.write_table(table, target, compression="zstd"))


def read_catalog(path: str | Path) -> Any:
    """The catalogue (pyarrow.Table) of a folder or a file. CatalogError if there is none."""
    pa = arrow()
    path = Path(path)
    file = path / FILE if path.is_dir() else path
    try:
        # read it as one file, not as a data set: names of folders are not columns
        table = pa.parquet.ParquetFile(regular(file)).read()
    except FileNotFoundError:
        raise CatalogError(
            f"{file}: there is no catalogue; make one with fclib collection build --out {path}"
        ) from None
    except (OSError, pa.ArrowInvalid) as error:
        reason = reason_of(error)
        raise CatalogError(f"{file}: cannot be read as a catalogue: {reason}") from None
    for name in ("id", "digest", *FILES):
        if name not in table.column_names:
            raise CatalogError(f"{file}: is no catalogue, it has no column {name!r}")
    for name, kind, _ in COLUMNS:
        wanted = pa.type_for_alias(kind)
        if name in table.column_names and table[name].type != wanted:
            place = table.column_names.index(name)
            try:
                table = table.set_column(place, name, table[name].cast(wanted))
            except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
                raise CatalogError(f"{file}: column {name}: is no {kind}") from None
    for name in FOLDERS:
        _require_inside(file, table, name)
    # an older catalogue lacks later columns
    for place, (name, kind, _) in enumerate(COLUMNS):
        if name not in table.column_names:
            nothing = pa.nulls(table.num_rows, pa.type_for_alias(kind))
            table = table.add_column(place, name, nothing)
    return table


# the names of RT-0444 for columns, in conditions
ALIASES: Mapping[str, str] = {"mu": "mu_max", "dof": "n"}
COMPARISONS: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


def where(table: Any, condition: str) -> Any:
    """The rows of a catalogue of which a condition is true; one on a missing value is not.

    Args:
        table: as `read_catalog` returns it.
        condition: comparisons of columns, numbers and texts, with and, or, not and brackets:
            "nc > 1000 and mu < 0.5 and family != 'Chain'". `mu` is mu_max, `dof` is n. `same_as is
            None` asks for a missing value.

    Raises:
        ConditionError: it is not one, or names no column.
    """
    pa = arrow()
    compute = importlib.import_module("pyarrow.compute")

    def term(node: ast.expr) -> Any:
        if isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float, str)):
            return compute.scalar(node.value)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = getattr(node.operand, "value", None)
            if isinstance(value, (int, float)):
                return compute.scalar(-value)
        if isinstance(node, ast.Name):
            name = ALIASES.get(node.id, node.id)
            if name in table.column_names:
                return compute.field(name)
            raise ConditionError(
                f"{condition!r}: there is no column {node.id!r};"
                f" {suggestion(node.id, table.column_names)}"
                f"there is: {', '.join(sorted(table.column_names))}"
            )
        raise refused(node)

    def comparison(left: ast.expr, relation: ast.cmpop, right: ast.expr) -> Any:
        if isinstance(relation, (ast.Is, ast.IsNot)):
            if not (isinstance(right, ast.Constant) and right.value is None):
                raise refused(right)
            return (
                term(left).is_valid() if isinstance(relation, ast.IsNot) else term(left).is_null()
            )
        if type(relation) in COMPARISONS:
            return COMPARISONS[type(relation)](term(left), term(right))
        raise refused(right)

    def truth(node: ast.expr) -> Any:
        if isinstance(node, ast.BoolOp):
            join = operator.and_ if isinstance(node.op, ast.And) else operator.or_
            return functools.reduce(join, map(truth, node.values))
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return ~truth(node.operand)
        if isinstance(node, ast.Compare):
            values = [node.left, *node.comparators]
            parts = map(comparison, values, node.ops, values[1:])
            return functools.reduce(operator.and_, parts)
        if isinstance(node, ast.Name):
            return term(node)
        raise refused(node)

    def refused(node: ast.expr) -> ConditionError:
        return ConditionError(
            f"{condition!r}: {ast.unparse(node)!r} is not understood; write comparisons of columns,"
            ' as in "nc > 1000 and mu < 0.5"'
        )

    try:
        asked = truth(ast.parse(condition.strip(), mode="eval").body)
        return table.filter(asked)
    except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        if isinstance(error, ConditionError):
            raise
        reason = error.msg if isinstance(error, SyntaxError) else str(error).partition("\n")[0]
        raise ConditionError(
            f"{condition!r}: is no condition: {reason or 'too long'}; write one as in"
            ' "nc > 1000 and mu < 0.5"'
        ) from None
    except (NotImplementedError, TypeError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise ConditionError(f"{condition!r}: values that cannot be compared: {reason}") from None


def with_copies(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The rows; each names the first row with the same data, if that is another one."""
    first: dict[str, str] = {}
    found = []
    for row in rows:
        original = first.setdefault(_data_of(row), row["id"])
        found.append({**row, "same_as": None if original == row["id"] else original})
    return found


def is_proven(row: Mapping[str, Any]) -> bool:
    """Whether the problem of a row is proven to have no solution."""
    return bool(row["status"] == PROVEN)


def is_answered(row: Mapping[str, Any]) -> bool:
    """Whether its solution is known, or known not to exist."""
    return is_solved(row) or is_proven(row)


def is_solved(row: Mapping[str, Any]) -> bool:
    """Whether its solution is stored; an older catalogue only has the solver's status."""
    stored = row["has_solution"]
    return bool(row["status"] == "converged" if stored is None else stored)


def distinct(rows: Iterable[Mapping[str, Any]]) -> int:
    """How many different problems there are."""
    return len({_data_of(row) for row in rows})


def _data_of(row: Mapping[str, Any]) -> str:
    """What equal problems share; a catalogue of somebody else's may have no digests."""
    return str(row["digest"] or row["id"])


def _require_inside(file: Path, table: Any, name: str) -> None:
    """CatalogError if a column names files or folders outside of the catalogue's own."""
    if name not in table.column_names:
        return
    for path in set(table[name].to_pylist()) - {None}:
        parts = path.split("/") if isinstance(path, str) else [""]
        one = name in ("collection", "family")
        if {"", ".", ".."} & set(parts) or "\0" in path or (one and len(parts) > 1):
            raise CatalogError(
                f"{file}: column {name}: {path!r} leads out of the catalogue's folder; do not use"
                " it, and tell whom it is from"
            )


def gather(out: Path) -> Any:
    """Join the catalogues of all families of a folder into its own.

    If the build of a family goes on, or was cut, it has the problems up to the last checkpoint.
    """
    rows = [
        row for part in sorted(out.glob(f"*/*/{FILE}")) for row in read_catalog(part).to_pylist()
    ]
    for family in unfinished(out):
        rows += kept_rows(out, family)
    write_catalog(out / FILE, rows)
    return read_catalog(out)


def unfinished(out: Path) -> list[str]:
    """The families SET/FAMILY of a folder whose build still goes on, or was cut."""
    return sorted(
        state.parent.relative_to(out).as_posix()
        for state in out.glob(f"*/*/{STATE}")
        if not (state.parent / FILE).is_file()
    )


def kept_rows(out: Path, family: str) -> list[dict[str, Any]]:
    """The rows that a family has so far, of problems whose files are there."""
    try:
        known = json.loads((out / family / STATE / KEPT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return []
    rows = [dict.fromkeys(FILES) | row for row in known["rows"]]
    return [row for row in rows if all((out / path).is_file() for path, _ in files_of(row))]


def lacking(out: Path, rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """The files of problems below a folder that its catalogue lacks."""
    known = {path for row in rows for path, _ in files_of(row)}
    found = (path.relative_to(out).as_posix() for path in out.glob("*/*/[!.]*.hdf5"))
    return sorted(path for path in found if path not in known)


def files_of(row: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Path and SHA-256 of each file of a row."""
    found = ((row[f"{form}_file"], row[f"{form}_sha256"]) for form in ("global", "local"))
    return [(path, digest) for path, digest in found if path is not None]


def sha256(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
