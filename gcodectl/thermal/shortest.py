"""Dijkstra's A* with greedy initialisation over the graph of `graph.py`: opens only nodes that may lead to the best.

    OPEN: a heap by dist + h      S o----o----o           dist: cheapest known way from S
    UPPER: cost of the best           \\    \\   :\\         h:    what the rest must cost at least
    known way to the end               o----o-:-o---o E   a node enters OPEN only if dist_p + a_pq < dist_q
                                        greedy way        and dist_p + a_pq + h_q <= UPPER

The published heuristic, a local solver's speed plan from the stage's first node, is no lower bound: a local solver may
miss the optimum, and constant speeds a partition are no relaxation of speeds that change inside one. Here
h is the exact cost to go of a relaxation of this very graph, in which the head may drive every location's stretch at
any speed, each for itself, and only the times at the borders hold the way together:

    h[N, i] = end_weight t_i
    h[j, i] = min over i' of  m(j, i, i') + h[j + 1, i']
    m(j, i, i') = sum over k of  min of weight_k (T_k(t) - T_best)^2  over the t at which k can be passed

Claim: h[j, i] is at most the cost to go of every node (j, i, v) of the graph, and never falls by more than the cost of
an arc (it is consistent), so that a node that left OPEN is settled, and A* ends with the cost DP finds.
Proof: let an arc lead from (j, i, v0) to (j + 1, i', v1), at the time t_i + pause when it begins to move, and of
duration D. Its speed is between v0 and v1 throughout, so in [low, high], the least and the greatest speed of borders j
and j + 1 (of j + 1 alone, where any speed may begin). The location at way k is thus passed in [k / high, k / low] after
the beginning, and the rest of the length, d - k, takes [(d - k) / high, (d - k) / low] before the end. The end lies
within half a step of t_i', because i' is the nearest to it, so the location is passed in the meet of [t + k / high, t +
k / low] and [t_i' - step / 2 - (d - k) / low, t_i' + step / 2 - (d - k) / high]. A least over that interval is no more
than the value at the time itself, so m(j, i, i') <= cost of the arc. T is monotone in t, so the least of a square over
an interval is at an end of it, or 0 where T_best lies between. If m admits every i' that an arc reaches, which it does
(D is in [d / high, d / low]), then h[j, i] <= m(j, i, i') + h[j + 1, i'] <= arc + h[j + 1, i']: consistent. h[N] is
exact; by induction from the end, h is at most the cost to go. In the mean form m takes the mean's interval. []

Source: Fathizadan, dissertation (Arizona State University, 2022), section 4.3.3, algorithm 1 (its lost test
`< dist_q` is back), proposition 3; Hart, Nilsson and Raphael 1968.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.dynamic import Route, lands_kernel
from gcodectl.thermal.graph import Graph, cost_kernel, lifted_kernel
from gcodectl.thermal.heap import lower_kernel, raise_kernel

OPENED, WAITING = range(2)
"""What is counted: nodes opened, nodes in the heap."""
SETTLED = -2


def shortest(graph: Graph) -> Route:
    """Return the cheapest route by A*."""
    problem, lattice = graph.problem, graph.lattice
    n, times, speeds = len(problem.length), lattice.times, lattice.speeds
    nodes = (n + 1) * times * speeds
    rank, distance = np.full((2, nodes), math.inf)
    parent, place = np.full((2, nodes), -1, dtype=np.int64)
    counts, room = np.zeros(2, dtype=np.int64), np.empty(int(np.diff(problem.first).max()))
    node = astar_kernel(
        problem.first, problem.under, problem.lift, problem.b1, problem.t0, problem.weight, problem.of_mean,
        problem.start_weight, graph.speed, graph.duration, graph.opens, graph.shuts, graph.decay, graph.offset,
        graph.free, lattice.time_base, lattice.time_step, lattice.time_first, least_to_go(graph), rank, distance,
        parent, np.empty(nodes, dtype=np.int64), place, counts, np.full(1, math.inf), room,
    )  # fmt: skip
    if node < 0:
        return Route(math.inf, math.nan, np.full(n, math.nan), int(counts[OPENED]))
    chosen = [int(node)]
    while parent[chosen[-1]] >= 0:
        chosen.append(int(parent[chosen[-1]]))
    found = np.array(chosen[::-1])
    row = int(lattice.time_first[0]) + int(found[0]) // speeds
    return Route(
        cost=float(rank[node]), start=lattice.time_base + lattice.time_step * row,
        speeds=graph.speed[np.arange(1, n + 1), found[1:] % speeds], nodes=int(counts[OPENED]),
    )  # fmt: skip


def least_to_go(graph: Graph) -> Floats:
    """Return h, a lower bound of the cost to go: borders x times."""
    problem, lattice = graph.problem, graph.lattice
    bound = np.full((len(problem.length) + 1, lattice.times), math.inf)
    bound_kernel(
        problem.first, problem.way, problem.under, problem.lift, problem.b1, problem.t0, problem.opens, problem.shuts,
        problem.weight, problem.of_mean, problem.end_weight, problem.length, problem.pause, graph.free, graph.speed,
        lattice.time_base, lattice.time_step, lattice.time_first, bound,
    )  # fmt: skip
    return bound


@jit_lean
def bound_kernel(
    first: Ints, way: Floats, under: Floats, lift: Floats, b1: Floats, t0: Floats, opens: Floats, shuts: Floats,
    weight: Floats, of_mean: bool, end_weight: float, length: Floats, pause: Floats, free: Ints, speed: Floats,
    base: float, step: float, time_first: Ints, bound: Floats,
) -> None:  # fmt: skip
    """Fill h, borders x times; it comes as inf."""
    stages, times = bound.shape[0] - 1, bound.shape[1]
    for i in range(times):
        bound[stages, i] = end_weight * (base + step * (time_first[stages] + i))
    for j in range(stages - 1, -1, -1):
        low, high = math.inf, 0.0
        for border in range(j + 1 if free[j] else j, j + 2):
            for a in range(speed.shape[1]):
                if not math.isnan(speed[border, a]):
                    low, high = min(low, speed[border, a]), max(high, speed[border, a])
        if high <= 0.0:
            continue
        low, high = low * (1.0 - 1e-9), high * (1.0 + 1e-9)
        for i in range(times):
            t = base + step * (time_first[j] + i) + pause[j]
            early = lands_kernel(i, pause[j] + length[j] / high, step, time_first[j], time_first[j + 1])
            late = lands_kernel(i, pause[j] + length[j] / low, step, time_first[j], time_first[j + 1])
            for lands in range(max(early - 1, 0), min(late + 2, times)):
                if bound[j + 1, lands] >= bound[j, i]:
                    continue
                end = base + step * (time_first[j + 1] + lands)
                least = 0.0
                coldest = hottest = 0.0
                for row in range(first[j], first[j + 1]):
                    rest = length[j] - way[row]
                    sooner = max(t + way[row] / high, end - 0.501 * step - rest / low, opens[row])
                    later = min(t + way[row] / low, end + 0.501 * step - rest / high, shuts[row])
                    if sooner > later + 1e-9:
                        least = math.inf
                        break
                    hot = under[row] + lift[row] * math.exp(b1[row] * (sooner - t0[row]))
                    cold = under[row] + lift[row] * math.exp(b1[row] * (later - t0[row]))
                    if of_mean:
                        coldest += min(cold, hot)
                        hottest += max(cold, hot)
                    elif hot * cold > 0.0:
                        least += weight[row] * min(hot * hot, cold * cold)
                        if least + bound[j + 1, lands] >= bound[j, i]:
                            break
                if of_mean and least == 0.0 and coldest * hottest > 0.0:
                    size = first[j + 1] - first[j]
                    least = weight[first[j]] * (min(abs(coldest), abs(hottest)) / size) ** 2
                # a hair less: sums are rounded, and the proof is about reals
                bound[j, i] = min(bound[j, i], (1.0 - 1e-12) * least + bound[j + 1, lands])


@jit_lean
def open_kernel(
    node: int, first: Ints, under: Floats, lift: Floats, b1: Floats, t0: Floats, weight: Floats, of_mean: bool,
    duration: Floats, opens: Floats, shuts: Floats, decay: Floats, offset: Ints, free: Ints, base: float, step: float,
    time_first: Ints, bound: Floats, rank: Floats, distance: Floats, parent: Ints, heap: Ints, place: Ints,
    counts: Ints, upper: Floats, lifted: Floats,
) -> int:  # fmt: skip
    """Try all arcs of a node that is not at the last border; returns the best child that became nearer, or -1."""
    stages, times, speeds = duration.shape[0], bound.shape[1], duration.shape[1]
    j, i, a = node // (times * speeds), (node // speeds) % times, node % speeds
    a = 0 if free[j] else a
    t = base + step * (time_first[j] + i)
    n = first[j + 1] - first[j]
    lifted_kernel(first[j], first[j + 1], t, lift, b1, t0, lifted)
    counts[OPENED] += 1
    best = -1
    for b in range(speeds):
        lasts = duration[j, a, b]
        if not (t >= opens[j, a, b] and t <= shuts[j, a, b] and lasts >= 0.0):
            continue
        lands = lands_kernel(i, lasts, step, time_first[j], time_first[j + 1])
        if lands < 0 or lands >= times:
            continue
        child = ((j + 1) * times + lands) * speeds + b
        room = min(distance[child], upper[0] - bound[j + 1, lands])
        if place[child] == SETTLED or distance[node] >= room:
            continue
        where = offset[j] + (a * speeds + b) * n
        way = distance[node] + cost_kernel(first[j], n, where, under, lifted, decay, weight, of_mean)
        if way >= distance[child] or way > upper[0] - bound[j + 1, lands]:
            continue
        distance[child], parent[child], rank[child] = way, node, way + bound[j + 1, lands]
        if place[child] < 0:
            place[child] = counts[WAITING]
            heap[counts[WAITING]] = child
            counts[WAITING] += 1
        raise_kernel(heap, place, rank, place[child])
        if best < 0 or rank[child] < rank[best]:
            best = child
        if j + 1 == stages:  # a hair more than it is, so that the sum's rounding shuts nobody out
            upper[0] = min(upper[0], rank[child] + 1e-12 * abs(rank[child]))
    return best


@jit_lean
def astar_kernel(
    first: Ints, under: Floats, lift: Floats, b1: Floats, t0: Floats, weight: Floats, of_mean: bool,
    start_weight: float, speed: Floats, duration: Floats, opens: Floats, shuts: Floats, decay: Floats, offset: Ints,
    free: Ints, base: float, step: float, time_first: Ints, bound: Floats, rank: Floats, distance: Floats,
    parent: Ints, heap: Ints, place: Ints, counts: Ints, upper: Floats, lifted: Floats,
) -> int:  # fmt: skip
    """Return the node at the last border that the cheapest way ends at, or -1; `parent` leads back.

    A node is (border * times + row of its time) * speeds + its speed's. They come so: `rank`, `distance`: inf,
    `place` (in the heap): -1, `parent`: -1, `counts`: 0, `upper`: inf; `lifted`: room for a partition's locations.
    """
    stages, times, speeds = duration.shape[0], bound.shape[1], speed.shape[1]
    for i in range(times):
        for a in range(speeds):
            if bound[0, i] < math.inf and not math.isnan(speed[0, a]):
                node = i * speeds + a
                distance[node] = start_weight * (base + step * (time_first[0] + i))
                rank[node] = distance[node] + bound[0, i]
                heap[counts[WAITING]] = node
                raise_kernel(heap, place, rank, counts[WAITING])
                counts[WAITING] += 1
                if free[0]:  # then speeds before it are all alike
                    break
    node = heap[0] if counts[WAITING] > 0 else -1
    while node >= 0 and node // (times * speeds) < stages:  # greedy: from the best start the best arc, to the end
        node = open_kernel(
            node, first, under, lift, b1, t0, weight, of_mean, duration, opens, shuts, decay, offset, free, base, step,
            time_first, bound, rank, distance, parent, heap, place, counts, upper, lifted,
        )  # fmt: skip
    while counts[WAITING] > 0:
        node = heap[0]
        counts[WAITING] -= 1
        if counts[WAITING] > 0:
            heap[0] = heap[counts[WAITING]]
            lower_kernel(heap, place, rank, counts[WAITING])
        place[node] = SETTLED
        if node // (times * speeds) == stages:
            return int(node)
        open_kernel(
            node, first, under, lift, b1, t0, weight, of_mean, duration, opens, shuts, decay, offset, free, base, step,
            time_first, bound, rank, distance, parent, heap, place, counts, upper, lifted,
        )  # fmt: skip
    return -1
