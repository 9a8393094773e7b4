"""The network of contacts of a problem: bodies, contact points, normals, their places in space.

The groups /bodies and /contacts of a file have these. Without them, H gives more than it seems to,
if bodies are free and rigid: its block of a contact and a body is

    H_v = T            (3 x 3), the contact's frame, columns N, T1, T2, in space
    H_w = Q^T [l]x T   (3 x 3), l from the body's centre to the contact point, Q the body's rotation

so that A = H_w T^T = Q^T [l]x gives l l^T = (tr(A^T A) / 2) I - A^T A, hence l up to its sign;
A_j^T A_k = (l_j . l_k) I - l_k l_j^T ties the signs of all contacts of a body to each other, and
the last sign is the one for which Q is a rotation (or, with one contact, the one for which the body
lies on the side it is pushed to, as a convex body does). Two bodies in contact share its point,
x_a + l_a = x_b + l_b, which gives the positions of all bodies that hang together, by least squares.
Groups without a contact between them are set down beside each other, at their heights over
the ground.

This is safe if M has six rows for each touched body, with one mass and the inertia only, and one
rotation Q fits all of its contacts: a node of a mesh, or a body with joints, has no such rows.
Otherwise there is only a graph, without the places of bodies.

In a periodic cell x_a + l_a = x_b + l_b + s, with s of whole periods, which the file gives. For
contacts that form a tree, s may be 0. At the others the positions leave gaps, which are rounded to
their s.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import scipy.sparse.csgraph
import scipy.sparse.linalg

from fclib._geometry import Bodies, Contacts
from fclib._origin import origin_of

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

FRAME = 1e-6  # largest deviation of a frame's columns from orthonormality
# largest distance of shared contact points, relative to the levers, for a valid result
MISFIT = 0.05
RIGID = 1e-6  # largest relative difference of a rigid body's moments from those of levers
EDGES = 20_000  # largest number of edges of a graph that pull during its layout
ROUNDING = 1e-12  # an entry of H below this share of the largest counts as zero
GROUND = 1e-2  # weight of a plane ground, relative to that of shared points


@dataclass
class Network:
    """Bodies that have a contact, and contacts, in space; the ground is body -1."""

    source: str  # of positions: "file", "H", or "graph" if they are not known
    bodies: Array  # (bodies, 3) [m] if placed
    points: Array  # (contacts, 3)
    pairs: Indices  # (contacts, 2) bodies of each contact
    frames: Array | None  # (contacts, 3, 3) columns N, T1, T2, pushing the first body
    note: str = ""
    limits: Indices | None = None  # contacts without a place: limits of joints, dry friction
    # (contacts, 3) from the place at the second body to that at the first; 0 except across a
    # boundary
    shifts: Array | None = None
    cell: Array | None = None  # (2, 2) lowest and highest x, y of a periodic cell

    @property
    def placed(self) -> bool:
        """Whether positions are known."""
        return self.source != "graph"


@dataclass
class _Body:
    first: int
    size: int
    free: bool
    levers: dict[int, Array] = field(default_factory=dict)  # contact -> (3)


def network_of(problem: Any) -> Network:
    """The network of a problem in any formulation; nc is at least 1."""
    if problem.bodies is not None and problem.contacts is not None:
        return given(problem.bodies, problem.contacts)
    if getattr(problem, "H", None) is None:
        return _of_local(problem)
    H = sp.csc_array(problem.H, copy=True)
    # entries of H that are only rounding tie no body to a contact
    H.data[np.abs(H.data) <= ROUNDING * np.abs(H.data).max(initial=0.0)] = 0.0
    H.eliminate_zeros()
    d = problem.spacedim
    bodies = _bodies_of(problem, H)
    owner = np.full(problem.n, -1)
    for number, body in enumerate(bodies):
        owner[body.first : body.first + body.size] = number
    pairs = np.full((problem.nc, 2), -1)
    for contact in range(problem.nc):
        rows = H.indices[H.indptr[d * contact] : H.indptr[d * (contact + 1)]]
        touched = np.unique(owner[rows])
        # a row of H beyond the first two bodies would be a joint, which lies in G
        pairs[contact, : min(2, touched.size)] = touched[:2]
    touched, numbers = np.unique(pairs, return_inverse=True)
    kept = touched[touched >= 0]
    pairs = numbers.reshape(pairs.shape) - (touched.size - kept.size)
    bodies = [bodies[number] for number in kept]
    if d >= 3 and all(body.free for body in bodies):
        found = _place(problem.nc, d, H, bodies, pairs, _period_of(problem))
        if found is not None:
            return found
    return _lay_out(len(bodies), pairs, "as a graph: H is not that of free rigid bodies in space")


def given(bodies: Bodies, contacts: Contacts) -> Network:
    """The network from a file: the force of a contact pushes the second of its two bodies."""
    pairs = np.asarray(contacts.body[:, ::-1], dtype=np.int64)
    limits = np.flatnonzero((contacts.shape < 0).any(axis=1))
    found = Network(
        "file",
        np.asarray(bodies.place),
        np.asarray(contacts.point),
        pairs,
        np.swapaxes(contacts.frame, 1, 2),
        limits=limits,
    )
    if len(bodies.period):
        period = np.array([*bodies.period, np.inf])
        # take the nearest images of both bodies
        ends = [_whole(contacts.point - bodies.place[pairs[:, side]], period) for side in (0, 1)]
        shifts = ends[1] - ends[0]
        shifts[limits] = 0.0
        found.shifts = shifts
        # a contact is drawn at the first of its bodies
        found.points = found.points - ends[0]
        found.shifts = shifts
    return found


def _period_of(problem: Any) -> Array | None:
    """The periods (3) along x, y and z of the cell that a problem was simulated in."""
    try:
        x, y = origin_of(problem.info)["period"]
        return np.array([float(x), float(y), np.inf])
    except (IndexError, KeyError, TypeError, ValueError):
        return None  # it does not tell its cell, or it has none


# ---- bodies


def _bodies_of(problem: Any, H: Any) -> list[_Body]:
    """Blocks of degrees of freedom: those that M or G couples, and six for each free rigid body."""
    coupled = abs(sp.csr_array(problem.M))
    G = getattr(problem, "G", None)
    if G is not None and problem.p:
        G = abs(sp.csr_array(G))
        coupled = coupled + G @ G.T
    _, label = scipy.sparse.csgraph.connected_components(coupled, directed=False)
    # the last degree of freedom of each component, so that blocks can be cut between them
    last = np.zeros(problem.n, int)
    np.maximum.at(last, label, np.arange(problem.n))
    ends = np.maximum.accumulate(last[label])
    cut = np.flatnonzero(ends == np.arange(problem.n))
    size = problem.spacedim
    rows = sp.csr_array(H)
    M = sp.csr_array(problem.M)
    bodies = []
    start = 0
    while start < problem.n:
        end = int(cut[np.searchsorted(cut, start)]) + 1
        six = start + 6
        free = False
        # the rows of a free body's place and rotation; M may couple them in blocks of its own
        if size >= 3 and end <= six <= problem.n and six - 1 in cut:
            own = M[start:six, start:six].toarray()
            free = _is_free(rows, own, size, start)
            if free:
                end = six
        bodies.append(_Body(start, end - start, free))
        start = end
    return bodies


def _is_free(H: Any, M: Array, d: int, first: int) -> bool:
    """Whether six degrees of freedom are the velocity of a rigid body's centre and its rotation.

    Their mass must be a single number, and the first three rows of H must be frames.
    """
    mass = M[0, 0]
    if np.abs(M[:3] - np.eye(3, 6) * mass).max() > FRAME * mass:
        return False
    block = H[first : first + 6]
    contacts = np.unique(block.indices // d)
    if not contacts.size:
        return True
    # (3, contacts, 3): the columns of the frames, if they are frames
    T = block[:3].toarray().reshape(3, -1, d)[:, contacts, :3]
    return bool(np.abs(np.einsum("ikp,ikq->kpq", T, T) - np.eye(3)).max() < FRAME)


# ---- positions


def _place(
    nc: int, d: int, H: Any, bodies: list[_Body], pairs: Indices, period: Array | None
) -> Network | None:
    rows = sp.csr_array(H)
    frames = np.zeros((nc, 3, 3))
    known = np.zeros(nc, bool)
    for number, body in enumerate(bodies):
        if not body.free:
            continue
        own = np.flatnonzero((pairs == number).any(axis=1))
        part = rows[body.first : body.first + 6].toarray()
        moments, T = {}, {}
        for contact in own.tolist():
            block = part[:, d * contact : d * contact + 3]
            T[contact] = block[:3]
            moments[contact] = block[3:] @ block[:3].T
        body.levers = _levers(moments, T)
        if not _is_rigid(moments, body.levers):
            return None
        for contact in own.tolist():
            if not known[contact] or pairs[contact, 0] == number:
                frames[contact] = T[contact]
                if pairs[contact, 0] != number:
                    frames[contact] *= -1.0  # the first body is pushed the other way
                known[contact] = True
    if not known.all():
        return None
    sizes = [np.linalg.norm(lever) for body in bodies for lever in body.levers.values()]
    scale = float(np.sqrt(np.mean(np.square(sizes)))) or 1.0
    shifts = np.zeros((nc, 3))
    if period is not None:
        shifts = _shifts(bodies, pairs, _along_a_tree(bodies, pairs), period)
    centres, misfit = _solve(bodies, pairs, frames, shifts, scale)
    if misfit > MISFIT:
        return None
    label = _groups(pairs, len(bodies))
    cell = None
    if period is not None and shifts.any():
        # centre the cell on the bodies that its boundary joins
        inside = label == label[pairs[np.flatnonzero(shifts.any(axis=1))[0], 0]]
        middle = centres[inside].mean(axis=0)
        centres[inside] -= _whole(centres[inside] - middle, period)
        shifts = _shifts(bodies, pairs, centres, period)
        cell = np.array([middle - 0.5 * period, middle + 0.5 * period])[:, :2]
    points = np.zeros((nc, 3))
    for contact in range(nc):
        sides = [(k, int(b)) for k, b in enumerate(pairs[contact]) if b >= 0 and bodies[b].free]
        ends = [centres[b] + bodies[b].levers[contact] + k * shifts[contact] for k, b in sides]
        points[contact] = np.mean(ends, axis=0)
    groups = int(label.max()) + 1
    if groups > 1:
        moves = _set_down(label, pairs, centres, points)
        centres += moves[label]
        points += moves[label[pairs[:, 0]]]
        if cell is not None:
            cell += moves[label[inside.argmax()], :2]
    note = "positions recovered from H"
    if cell is not None:
        note += "; a contact across the boundary of the periodic cell is drawn on both sides"
    if groups > 1:
        note += f"; its {groups} groups that do not touch stand beside each other as it fits"
    found = Network("H", centres, points, pairs, frames, note)
    if cell is not None:
        found.shifts, found.cell = shifts, cell
    return found


def _along_a_tree(bodies: list[_Body], pairs: Indices) -> Array:
    """Centres (bodies, 3) from one contact for each body except the first of its group."""
    contacts = [k for k, pair in enumerate(pairs) if all(b >= 0 and bodies[b].free for b in pair)]
    between = {frozenset(pairs[k].tolist()): k for k in contacts}
    centres = np.zeros((len(bodies), 3))
    graph = _graph(pairs[contacts], len(bodies))
    seen = np.zeros(len(bodies), bool)
    for start in range(len(bodies)):
        if seen[start]:
            continue
        order, parents = scipy.sparse.csgraph.breadth_first_order(graph, start, directed=False)
        seen[order] = True
        for body in order[1:].tolist():
            parent = int(parents[body])
            k = between[frozenset((body, parent))]
            centres[body] = centres[parent] + bodies[parent].levers[k] - bodies[body].levers[k]
    return centres


def _shifts(bodies: list[_Body], pairs: Indices, centres: Array, period: Array) -> Array:
    """Whole periods (contacts, 3) between the places of each contact at its two bodies."""
    found = np.zeros((len(pairs), 3))
    for contact, (a, b) in enumerate(pairs.tolist()):
        if min(a, b) >= 0 and bodies[a].free and bodies[b].free:
            ends = [centres[n] + bodies[n].levers[contact] for n in (a, b)]
            found[contact] = _whole(ends[0] - ends[1], period)
    return found


def _whole(x: Array, period: Array) -> Array:
    """The whole periods in x (..., 3), to the nearest; 0 if a period is infinite."""
    count = np.round(x / period)
    return np.where(count == 0, 0.0, count * np.where(np.isinf(period), 0.0, period))


def _levers(moments: dict[Any, Array], frames: dict[Any, Array]) -> dict[int, Array]:
    """The levers of a body's contacts, from A = Q^T [l]x of each."""
    levers: dict[int, Array] = {}
    for contact, A in moments.items():
        S = A.T @ A
        _, vectors = np.linalg.eigh(0.5 * np.trace(S) * np.eye(3) - S)
        levers[contact] = vectors[:, -1] * np.sqrt(max(0.0, 0.5 * np.trace(S)))
    order = sorted(levers, key=lambda c: -float(np.linalg.norm(levers[c])))
    # fix each sign by the settled contact that tells most
    for k, contact in enumerate(order[1:], start=1):
        dots = [0.5 * float(np.sum(moments[contact] * moments[other])) for other in order[:k]]
        best = int(np.argmax(np.abs(dots)))
        if dots[best] * float(levers[contact] @ levers[order[best]]) < 0:
            levers[contact] = -levers[contact]
    # A = Q^T [l]x, and -l would give -Q
    total = sum(moments[c] @ _cross(levers[c]).T for c in order)
    values = np.linalg.svd(total, compute_uv=False)
    if values[-1] > 1e-9 * max(1e-300, values[0]):
        wrong = np.linalg.det(total) < 0
    else:
        wrong = sum(float(levers[c] @ frames[c][:, 0]) for c in order) > 0
    return {c: -lever if wrong else lever for c, lever in levers.items()}


def _is_rigid(moments: dict[Any, Array], levers: dict[int, Array]) -> bool:
    """Whether one rotation Q gives A = Q^T [l]x of all contacts, and not all levers are zero."""
    own = [(moments[c], _cross(levers[c])) for c in levers]
    size = max(float(np.abs(A).max()) for A, _ in own)
    if size == 0.0:
        return False
    # the nearest rotation, by Kabsch
    u, _, vt = np.linalg.svd(sum(A @ lever.T for A, lever in own))
    turn = np.diag([1.0, 1.0, float(np.linalg.det(u @ vt))])
    Q = u @ turn @ vt
    return all(float(np.abs(A - Q @ lever).max()) < RIGID * size for A, lever in own)


def _cross(x: Array) -> Array:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def _solve(
    bodies: list[_Body], pairs: Indices, frames: Array, shifts: Array, scale: float
) -> tuple[Array, float]:
    """Centres (bodies, 3) by least squares, and the distance of shared points over the scale."""
    i: list[int] = []
    j: list[int] = []
    x: list[float] = []
    right: list[float] = []
    planes: dict[tuple[int, ...], int] = {}
    first_plane = 3 * len(bodies)
    shared = 0
    for contact in range(len(pairs)):
        a, b = int(pairs[contact, 0]), int(pairs[contact, 1])
        levers = [(n, bodies[n].levers[contact]) for n in (a, b) if n >= 0 and bodies[n].free]
        if len(levers) == 2:
            (one, la), (other, lb) = levers
            for k in range(3):
                row = len(right)
                i += [row, row]
                j += [3 * one + k, 3 * other + k]
                x += [1.0, -1.0]
                right.append(float(lb[k] - la[k] + shifts[contact, k]))
                shared += 1
        elif b < 0:
            normal = frames[contact][:, 0]
            key = tuple(np.round(normal * 100).astype(int))
            plane = planes.setdefault(key, first_plane + len(planes))
            row = len(right)
            i += [row] * 4
            j += [3 * a, 3 * a + 1, 3 * a + 2, plane]
            x += [*(GROUND * normal).tolist(), -GROUND]
            right.append(-GROUND * float(normal @ levers[0][1]))
    shape = (len(right), first_plane + len(planes))
    A = sp.csr_array((x, (i, j)), shape=shape)
    distances = np.array(right)
    solved = scipy.sparse.linalg.lsqr(
        A, distances, atol=1e-12, btol=1e-12, iter_lim=20 * max(shape)
    )[0]
    gaps = (A @ solved - distances)[np.bincount(i, minlength=len(right)) == 2]
    misfit = float(np.sqrt(np.mean(gaps**2)) / scale) if gaps.size else 0.0
    return solved[:first_plane].reshape(-1, 3).copy(), misfit


def _graph(pairs: Indices, count: int) -> Any:
    """Which bodies touch (count x count)."""
    joined = pairs[(pairs >= 0).all(axis=1)]
    return sp.csr_array((np.ones(len(joined)), (joined[:, 0], joined[:, 1])), shape=(count, count))


def _groups(pairs: Indices, count: int) -> Indices:
    """The number (count) of the group of each body, a group is a connected set of bodies."""
    _, label = scipy.sparse.csgraph.connected_components(_graph(pairs, count), directed=False)
    return np.asarray(label)


def _set_down(label: Indices, pairs: Indices, centres: Array, points: Array) -> Array:
    """The displacements (groups, 3) that place groups beside each other."""
    groups = int(label.max()) + 1
    at = label[pairs[:, 0]]
    boxes = []
    for group in range(groups):
        # assume that a body's other end is as far as its contact
        own = points[at == group, :2]
        middle = centres[label == group, :2].mean(axis=0)
        half = np.abs(np.vstack([own, centres[label == group, :2]]) - middle).max(axis=0)
        boxes.append((middle, half))
    widths = np.array([2.2 * half.max() for _, half in boxes])
    widths = np.maximum(
        widths, 0.5 * np.median(widths[widths > 0], axis=None) if widths.any() else 1
    )
    row_end = 1.1 * float(np.sqrt((widths**2).sum()))
    x = y = height = 0.0
    moves = np.zeros((groups, 3))
    for group in np.argsort(-widths, kind="stable"):
        if x > 0 and x + widths[group] > row_end:
            x, y, height = 0.0, y + height, 0.0
        moves[group, :2] = (x + widths[group] / 2, y + widths[group] / 2) - boxes[group][0]
        x += widths[group]
        height = max(height, widths[group])
    return moves


# ---- graphs


def _of_local(problem: Any) -> Network:
    """The graph of a local problem: it has contacts and their coupling, but no bodies."""
    d = problem.spacedim
    W = problem.W
    entries = sp.coo_array(W if sp.issparse(W) else np.asarray(W))
    keep = entries.data != 0
    a, b = entries.row[keep] // d, entries.col[keep] // d
    edges = np.unique(np.column_stack([a, b])[a < b], axis=0)
    points = _spread(problem.nc, edges)
    pairs = np.full((problem.nc, 2), -1)
    note = "as a graph: points that W couples are near; a local problem does not know its bodies"
    return Network("graph", np.zeros((0, 3)), points, pairs, None, note)


def _lay_out(count: int, pairs: Indices, note: str) -> Network:
    """Bodies and contacts as the nodes of one graph."""
    contacts = np.arange(len(pairs)) + count
    edges = np.vstack(
        [np.column_stack([side, contacts])[side >= 0] for side in (pairs[:, 0], pairs[:, 1])]
    )
    nodes = _spread(count + len(pairs), edges)
    return Network("graph", nodes[:count], nodes[count:], pairs, None, note)


def _spread(count: int, edges: Indices, rounds: int = 60) -> Array:
    """Positions (count, 3) of the nodes of a graph, by Fruchterman & Reingold (1991)."""
    random = np.random.Generator(np.random.PCG64(0))
    side = max(1.0, count ** (1 / 3))
    x = random.uniform(-side, side, (count, 3))
    # with more nodes than this, a sample of the others pushes each node
    sample = min(count, 400)
    if len(edges) > EDGES:
        edges = edges[np.sort(random.choice(len(edges), EDGES, replace=False))]
    ends = np.arange(len(edges))
    towards = sp.csr_array(
        (
            np.repeat([1.0, -1.0], len(edges)),
            (np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([ends, ends])),
        ),
        shape=(count, len(edges)),
    )
    for k in range(rounds):
        others = random.choice(count, sample, replace=False) if sample < count else np.arange(count)
        away = x[:, None] - x[None, others]
        far = np.maximum((away**2).sum(axis=2), 1e-2)
        step = (away / far[:, :, None]).sum(axis=1) * (count / sample)
        if len(edges):
            along = x[edges[:, 1]] - x[edges[:, 0]]
            pull = along * np.linalg.norm(along, axis=1, keepdims=True)
            step += towards @ pull
        step -= 0.05 * x * side  # keeps groups that do not touch in the picture
        length = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
        x += step / length * np.minimum(length, 0.4 * side * (1 - k / rounds) + 1e-3)
    return np.asarray(x - x.mean(axis=0))
