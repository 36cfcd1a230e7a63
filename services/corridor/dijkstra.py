"""Dijkstra's algorithm over the cells of a clearance map, with an own indexed binary heap. Kernels only.

A node is a cell; its place is the cell's centre, or where that is too tight the roomiest of the nine lattice
points of the cell. So a passage is found whenever it fits on the lattice of half cells, at the price of a
search over whole cells. Equal costs are settled by node number: the result does not depend on anything else.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Eight neighbours, then eight knight's moves with the two cells each passes between.
_DI = np.array([1, -1, 0, 0, 1, 1, -1, -1, 2, 2, -2, -2, 1, 1, -1, -1], np.int64)
_DJ = np.array([0, 0, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 2, -2, 2, -2], np.int64)


@njit("f8(f8,f8,f8,f8)", cache=True)
def factor(clearance: float, need: float, comfort: float, weight: float) -> float:
    """Return the cost of a metre at `clearance`: 1 from `comfort` on, 1 + weight at `need`, quadratic."""
    short = max(0.0, (comfort - clearance) / (comfort - need))
    return 1.0 + weight * short * short


@njit("Tuple((f8[::1],f8[::1],f8[::1]))(f8[:,::1],f8,f8,f8,f8,f8,f8)", cache=True)
def places(
    values: Array,
    spacing: float,
    need: float,
    start_x: float,
    start_y: float,
    escape: float,
    start_need: float,
) -> tuple[Array, Array, Array]:
    """Return x, y (m from values[0, 0]) and clearance of every node; clearance -1 where it is too tight.

    Within `escape` m of the start `start_need` is enough.
    """
    ny, nx = (values.shape[0] - 1) // 2, (values.shape[1] - 1) // 2
    xs, ys, cs = np.empty(nx * ny), np.empty(nx * ny), np.empty(nx * ny)
    for j in range(ny):
        for i in range(nx):
            x, y, c = 2 * i + 1, 2 * j + 1, values[2 * j + 1, 2 * i + 1]
            if c < need:
                for b in range(2 * j, 2 * j + 3):
                    for a in range(2 * i, 2 * i + 3):
                        if values[b, a] > c:
                            x, y, c = a, b, values[b, a]
            px, py = x * spacing, y * spacing
            enough = need
            if c < need and (px - start_x) ** 2 + (py - start_y) ** 2 <= escape * escape:
                enough = start_need
            k = j * nx + i
            xs[k], ys[k], cs[k] = px, py, c if c >= enough else -1.0
    return xs, ys, cs


@njit("b1(f8[::1],i8,i8)", cache=True)
def _before(key: Array, a: int, b: int) -> bool:
    return key[a] < key[b] or (key[a] == key[b] and a < b)


@njit("void(f8[::1],i8[::1],i8[::1],i8)", cache=True)
def _rise(key: Array, heap: Index, place: Index, at: int) -> None:
    """Move the node at heap[at] up to where it belongs."""
    node = heap[at]
    while at > 0:
        parent = (at - 1) // 2
        if not _before(key, node, heap[parent]):
            break
        heap[at] = heap[parent]
        place[heap[at]] = at
        at = parent
    heap[at] = node
    place[node] = at


@njit("i8(f8[::1],i8[::1],i8[::1],i8)", cache=True)
def _pop(key: Array, heap: Index, place: Index, size: int) -> int:
    """Take the first node out of a heap of `size` and return it."""
    first, node = heap[0], heap[size - 1]
    place[first] = -1
    size -= 1
    at = 0
    while 2 * at + 1 < size:
        child = 2 * at + 1
        if child + 1 < size and _before(key, heap[child + 1], heap[child]):
            child += 1
        if not _before(key, heap[child], node):
            break
        heap[at] = heap[child]
        place[heap[at]] = at
        at = child
    if size > 0:
        heap[at] = node
        place[node] = at
    return first


@njit("i8(f8[::1],i8[::1],i8[::1],i8,i8)", cache=True)
def _push(key: Array, heap: Index, place: Index, size: int, node: int) -> int:
    """Put `node` in, or move it up where it is, and return the heap's size."""
    if place[node] < 0:
        heap[size] = node
        place[node] = size
        size += 1
    _rise(key, heap, place, place[node])
    return size


@njit("Tuple((f8,i8[::1]))(f8[::1],f8[::1],f8[::1],i8,i8,i8,f8,f8,f8)", cache=True)
def cheapest(
    xs: Array,
    ys: Array,
    cs: Array,
    nx: int,
    start: int,
    goal: int,
    need: float,
    comfort: float,
    weight: float,
) -> tuple[float, Index]:
    """Return the cost and the nodes of the cheapest way from `start` to `goal`; infinity and none without.

    A step costs its length times the mean `factor` of its ends.
    """
    n = len(cs)
    ny = n // nx
    price = np.empty(n)
    for k in range(n):
        price[k] = factor(cs[k], need, comfort, weight) if cs[k] >= 0.0 else np.inf
    key = np.full(n, np.inf)
    heap, place, parent = np.empty(n, np.int64), np.full(n, -1, np.int64), np.full(n, -1, np.int64)
    key[start] = 0.0
    size = _push(key, heap, place, 0, start)
    while size > 0:
        u = _pop(key, heap, place, size)
        size -= 1
        if u == goal:
            break
        ui, uj = u % nx, u // nx
        for m in range(16):
            i, j = ui + _DI[m], uj + _DJ[m]
            if i < 0 or j < 0 or i >= nx or j >= ny:
                continue
            v = j * nx + i
            if cs[v] < 0.0 or key[v] <= key[u]:
                continue
            if m >= 8:
                hi, hj = _DI[m] // 2 if abs(_DI[m]) == 2 else 0, _DJ[m] // 2 if abs(_DJ[m]) == 2 else 0
                near = (uj + hj) * nx + ui + hi
                far = (j - hj) * nx + i - hi
                if cs[near] < 0.0 or cs[far] < 0.0:
                    continue
            length = math.sqrt((xs[u] - xs[v]) ** 2 + (ys[u] - ys[v]) ** 2)
            cost = key[u] + length * 0.5 * (price[u] + price[v])
            if cost < key[v]:
                key[v] = cost
                parent[v] = u
                size = _push(key, heap, place, size, v)
    count = 0
    if key[goal] < np.inf:
        k = goal
        while k >= 0:
            count += 1
            k = parent[k]
    nodes = np.empty(count, np.int64)
    k = goal
    for c in range(count - 1, -1, -1):
        nodes[c] = k
        k = parent[k]
    return key[goal], nodes


@njit("f8(f8[::1],i8,i8,i8)", cache=True)
def widest(cs: Array, nx: int, start: int, goal: int) -> float:
    """Return the greatest clearance with which `goal` can be reached from `start`; 0 if it cannot."""
    n = len(cs)
    ny = n // nx
    key = np.full(n, np.inf)
    heap, place = np.empty(n, np.int64), np.full(n, -1, np.int64)
    key[start] = -cs[start]
    size = _push(key, heap, place, 0, start)
    while size > 0:
        u = _pop(key, heap, place, size)
        size -= 1
        if u == goal:
            return -key[u]
        ui, uj = u % nx, u // nx
        for m in range(8):
            i, j = ui + _DI[m], uj + _DJ[m]
            if i < 0 or j < 0 or i >= nx or j >= ny:
                continue
            v = j * nx + i
            worst = max(key[u], -cs[v])
            if cs[v] > 0.0 and worst < key[v]:
                key[v] = worst
                size = _push(key, heap, place, size, v)
    return 0.0
