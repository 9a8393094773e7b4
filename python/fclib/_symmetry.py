"""The asymmetry of W, R and M of a problem."""

from __future__ import annotations

from typing import Any, Final

import scipy.sparse as sp

# max |A - A^T| / max |A| largest value for which a matrix counts as symmetric
SYMMETRIC: Final = 1e-12


def columns(a: Any) -> Any:
    """Any matrix as csc_array: duplicates added up, zeros left out."""
    result = sp.csc_array(a, copy=True)
    result.sum_duplicates()
    result.eliminate_zeros()
    return result


def largest(a: Any) -> float:
    """The largest |entry|."""
    return float(abs(a).max()) if a.nnz else 0.0


def asymmetry(a: Any) -> float:
    """Max |A - A^T| / max |A|, 0 for the zero matrix."""
    size = largest(a)
    return largest(columns(a - a.T)) / size if size else 0.0


def asymmetries(problem: Any) -> dict[str, float]:
    """The asymmetry of those of W, R and M that a problem has."""
    matrices = {name: getattr(problem, name, None) for name in ("W", "R", "M")}
    return {name: asymmetry(columns(a)) for name, a in matrices.items() if a is not None}


def not_symmetric(problem: Any) -> list[str]:
    """A line for each of W, R and M that is not symmetric: the amount, and a possible cause."""
    lines = []
    for name, skewness in asymmetries(problem).items():
        if skewness <= SYMMETRIC:
            continue
        line = f"{name} is not symmetric: max |{name} - {name}^T| is {skewness:.2g} of max |{name}|"
        a = columns(getattr(problem, name))
        if not sp.triu(a, 1).nnz or not sp.tril(a, -1).nnz:
            line += (
                ". It has one triangle alone. If that stands for both, its group in the file needs"
                " the attribute symmetric_packed = 1"
            )
        lines.append(line)
    return lines
