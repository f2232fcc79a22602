"""The same equations for many motors at once: one pulse train, many sets of parameters, `LANES` of them abreast.

The inner loops run over lanes, without branches, so that a compiler makes vector instructions of them; the arithmetic
is that of `kernel.advance`, operation by operation, and so are the results. The torque of the load is constant here.

Imported only where numba is. One file, as numba looks for changes only in the file of the function that it keeps
compiled.
"""

import numpy as np
from numba import njit, prange

from detent.motors.kernel import (
    ACC,
    AMPS,
    FAR,
    GAIN,
    IA,
    IB,
    KT,
    OFFSET,
    PIO2_HIGH,
    PIO2_LOW,
    PITCH,
    TC,
    TD,
    TEETH,
    TL,
    TWO_OVER_PI,
    TWO_PI,
    VOLTS,
    J,
    L,
    R,
    W,
    X,
)  # fmt: skip
from detent.motors.kernel import B as VISCOUS

LANES = 16
WORST, WORST_PULSE, LOST_PULSE = 5, 6, 7  # rows of the state, behind X, W, IA, IB, ACC
ROWS = 8
NEVER_LOST = 1e300


@njit(cache=True, error_model="numpy")
def advance_lanes(  # type: ignore[no-untyped-def]
    state,
    par,
    lane,
    t,
    place,
    level,
    row,
    mode,
    pulses,
    times,
    places,
    levels,
    rows,
    modes,
    until,
    table_a,
    table_b,
    substep,
):
    """Go on with the lanes from `lane` on, in `state` (rows by lanes), to `until`; see `kernel.advance`."""
    # one block of memory: so the compiler sees that no row overlaps another
    lanes = np.empty((24, LANES))
    x = lanes[0]
    w = lanes[1]
    ia = lanes[2]
    ib = lanes[3]
    acc = lanes[4]
    worst = lanes[5]
    worst_pulse = lanes[6]
    lost_pulse = lanes[7]
    want_a = lanes[8]
    want_b = lanes[9]
    least_a = lanes[10]
    most_a = lanes[11]
    least_b = lanes[12]
    most_b = lanes[13]
    kt = lanes[14]
    r = lanes[15]
    td = lanes[16]
    loaded = lanes[17]
    g = lanes[18]
    q = lanes[19]
    d = lanes[20]
    per_g = lanes[21]
    slowed = lanes[22]
    pushed = lanes[23]
    for i in range(LANES):
        x[i] = state[X, lane + i]
        w[i] = state[W, lane + i]
        ia[i] = state[IA, lane + i]
        ib[i] = state[IB, lane + i]
        acc[i] = state[ACC, lane + i]
        worst[i] = state[WORST, lane + i]
        worst_pulse[i] = state[WORST_PULSE, lane + i]
        lost_pulse[i] = state[LOST_PULSE, lane + i]
        kt[i] = par[KT, lane + i]
        r[i] = par[R, lane + i]
        td[i] = par[TD, lane + i] * 4.0
        loaded[i] = par[TL, lane + i]
    half_teeth = 0.5 * par[TEETH, lane]
    pitch = par[PITCH, lane]
    offset = par[OFFSET, lane]
    cycle = table_a.shape[1]
    count = len(times)
    event = 0
    cached = -1
    h = 0.0
    per_h = 0.0
    half_h = 0.0
    turned = 0.0
    pulse = float(pulses)
    while True:
        end = FAR
        if event < count:
            end = times[event]
        whole = end <= until
        stop = end
        if not whole:
            stop = until
        phi = offset + place * pitch
        at = place % cycle
        feedback = 1.0
        if mode == 2:
            feedback = 0.0
        both = 1.0  # a chopper whose voltage takes both signs
        if mode == 1:
            both = 0.0
        for i in range(LANES):
            amps = par[AMPS, lane + i] * level
            volts = par[VOLTS, lane + i]
            wa = amps * table_a[row, at]
            wb = amps * table_b[row, at]
            want_a[i] = wa
            want_b[i] = wb
            positive_a = 1.0 if wa > 0.0 else both
            negative_a = 1.0 if wa < 0.0 else both
            positive_b = 1.0 if wb > 0.0 else both
            negative_b = 1.0 if wb < 0.0 else both
            least_a[i] = feedback * -volts * negative_a + (1.0 - feedback) * wa * par[GAIN, lane + i]
            most_a[i] = feedback * volts * positive_a + (1.0 - feedback) * wa * par[GAIN, lane + i]
            least_b[i] = feedback * -volts * negative_b + (1.0 - feedback) * wb * par[GAIN, lane + i]
            most_b[i] = feedback * volts * positive_b + (1.0 - feedback) * wb * par[GAIN, lane + i]
            delta = abs(phi - x[i])
            worst_pulse[i] = pulse if delta > worst[i] else worst_pulse[i]
            worst[i] = max(delta, worst[i])
            lost_pulse[i] = min(lost_pulse[i], pulse if delta > TWO_PI else NEVER_LOST)
        while t < stop:
            step = stop - t
            if step >= substep:
                step = substep
            elif not whole:
                break
            if step != cached:
                cached = step
                h = step * 1e-9
                per_h = 1.0 / h
                half_h = 0.5 * h
                turned = half_teeth * h
                for i in range(LANES):
                    ell = par[L, lane + i]
                    j = par[J, lane + i]
                    z = h * r[i] / ell
                    phi2 = 0.5 - z * (1 / 6 - z * (1 / 24 - z * (1 / 120 - z * (1 / 720 - z * (1 / 5040 - z * (
                        1 / 40320 - z * (1 / 362880 - z * (1 / 3628800 - z / 39916800))))))))  # fmt: skip
                    g[i] = h / ell * (1.0 - z * phi2)
                    q[i] = h / ell * phi2
                    b_half = h * par[VISCOUS, lane + i] / (2.0 * j)
                    h_over_j = h / j
                    d[i] = h * par[TC, lane + i] / j
                    per_g[i] = 1.0 / g[i]
                    slowed[i] = (1.0 - b_half) / (1.0 + b_half)
                    pushed[i] = h_over_j / (1.0 + b_half)
            for i in range(LANES):
                wm = w[i] + half_h * acc[i]
                xm = x[i] + turned * (w[i] + 0.5 * half_h * acc[i])
                turns = np.floor(xm * TWO_OVER_PI + 0.5)
                y = (xm - turns * PIO2_HIGH) - turns * PIO2_LOW
                y2 = y * y
                sine = y - y * y2 * (1 / 6 - y2 * (1 / 120 - y2 * (1 / 5040 - y2 * (1 / 362880 - y2 * (
                    1 / 39916800 - y2 * (1 / 6227020800 - y2 * (1 / 1307674368000)))))))  # fmt: skip
                cosine = 1.0 - y2 * (0.5 - y2 * (1 / 24 - y2 * (1 / 720 - y2 * (1 / 40320 - y2 * (1 / 3628800 - y2 * (
                    1 / 479001600 - y2 * (1 / 87178291200 - y2 * (1 / 20922789888000))))))))  # fmt: skip
                pairs = np.floor(turns * 0.5)
                odd = turns - 2.0 * pairs
                half = pairs - 2.0 * np.floor(pairs * 0.5)
                flip = 1.0 - 2.0 * half
                sn = flip * (odd * cosine + (1.0 - odd) * sine)
                cs = flip * ((1.0 - odd) * cosine - odd * sine)
                ea = -kt[i] * wm * sn
                eb = kt[i] * wm * cs
                va = ea + r[i] * ia[i] + (want_a[i] - ia[i]) * per_g[i]
                vb = eb + r[i] * ib[i] + (want_b[i] - ib[i]) * per_g[i]
                va = min(max(va, least_a[i]), most_a[i])
                vb = min(max(vb, least_b[i]), most_b[i])
                ua = va - ea - r[i] * ia[i]
                ub = vb - eb - r[i] * ib[i]
                mean_a = ia[i] + ua * q[i]
                mean_b = ib[i] + ub * q[i]
                torque = kt[i] * (mean_b * cs - mean_a * sn)
                cogging = td[i] * sn * cs * (cs * cs - sn * sn)
                wn = w[i] * slowed[i] + pushed[i] * (torque - cogging - loaded[i])
                wn = max(wn - d[i], 0.0) + min(wn + d[i], 0.0)
                x[i] = x[i] + turned * (w[i] + wn)
                ia[i] = ia[i] + ua * g[i]
                ib[i] = ib[i] + ub * g[i]
                acc[i] = (wn - w[i]) * per_h
                w[i] = wn
                delta = abs(phi - x[i])
                worst_pulse[i] = pulse if delta > worst[i] else worst_pulse[i]
                worst[i] = max(delta, worst[i])
                lost_pulse[i] = min(lost_pulse[i], pulse if delta > TWO_PI else NEVER_LOST)
            t += step
        if not whole:
            break
        if places[event] != place:
            pulse += 1.0
        place = places[event]
        level = levels[event]
        row = rows[event]
        mode = modes[event]
        event += 1
    for i in range(LANES):
        state[X, lane + i] = x[i]
        state[W, lane + i] = w[i]
        state[IA, lane + i] = ia[i]
        state[IB, lane + i] = ib[i]
        state[ACC, lane + i] = acc[i]
        state[WORST, lane + i] = worst[i]
        state[WORST_PULSE, lane + i] = worst_pulse[i]
        state[LOST_PULSE, lane + i] = lost_pulse[i]
    return t


@njit(parallel=True, cache=True, error_model="numpy")
def advance_all(  # type: ignore[no-untyped-def]
    state,
    par,
    now,
    place,
    level,
    row,
    mode,
    pulses,
    times,
    places,
    levels,
    rows,
    modes,
    until,
    table_a,
    table_b,
    substep,
):
    """`advance_lanes` for every group of lanes in `state`. The time reached is that of each group."""
    groups = state.shape[1] // LANES
    ends = [0] * groups
    for group in prange(groups):
        ends[group] = advance_lanes(state, par, group * LANES, now, place, level, row, mode, pulses, times, places,
                                    levels, rows, modes, until, table_a, table_b, substep)  # fmt: skip
    return ends[0]
