"""The same equations for many motors at once: one pulse train, many sets of parameters, `LANES` of them abreast.

The inner loops run over lanes, without branches, so that a compiler makes vector instructions of them; the arithmetic
is that of `kernel.advance`, operation by operation, and so are the results. The torque of the load is constant here.

Imported only where numba is. One file, as numba looks for changes only in the file of the function that it keeps
compiled.
"""

from functools import partial

import numpy as np
from numba import prange

from detent.compiled import jit
from detent.motors.kernel import (
    ACC,
    AMPS,
    DAMPING,
    FALL,
    FAR,
    GAIN,
    GLIDE,
    IA,
    IB,
    KT,
    OFFSET,
    ONE_TURN,
    PITCH,
    ROLL_OFF,
    TC,
    TD,
    TEETH,
    TL,
    TURN_HIGH,
    TURN_LOW,
    TWO_PI,
    VOLTS,
    J,
    L,
    R,
    W,
    X,
)  # fmt: skip
from detent.motors.kernel import B as VISCOUS

LANES = 32
WORST, WORST_PULSE, LOST_PULSE = 5, 6, 7  # rows of the state, behind X, W, IA, IB, ACC
ROWS = 8
NEVER_LOST = 1e300


@jit
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
    pulsed,
    gap,
    previous,
    times,
    places,
    levels,
    rows,
    modes,
    until,
    table_a,
    table_b,
    substep,
    halt,
):
    """Go on with the lanes from `lane` on, in `state` (rows by lanes), to `until`; see `kernel.advance`.

    `halt`: stop, soon, where one of them is lost.
    """
    # one block of memory: so the compiler sees that no row overlaps another
    lanes = np.empty((34, LANES))
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
    damping = lanes[24]
    damped = lanes[25]
    worst_then = lanes[26]
    kept = lanes[27:33]  # g to pushed of a whole substep
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
        damping[i] = par[DAMPING, lane + i]
    roll_off = par[ROLL_OFF, lane]
    teeth = par[TEETH, lane]
    fall = par[FALL, lane]
    glide = par[GLIDE, lane]
    half_teeth = 0.5 * par[TEETH, lane]
    pitch = par[PITCH, lane]
    offset = par[OFFSET, lane]
    cycle = table_a.shape[1]
    count = len(times)
    event = 0
    cached = -1
    whole_known = False
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
        lowest = -1.0  # of the supply, against a current that shall fall
        if mode == 1:
            lowest = 0.0
        elif mode == 3:
            lowest = fall
        at_zero = min(lowest, 0.0)
        way = (place - previous) * pitch / teeth * 1e9
        even = way / gap
        damps = level / (1.0 + (even / roll_off) * (even / roll_off))
        fresh = True
        for i in range(LANES):
            worst_then[i] = worst[i]
            worst[i] = max(abs(phi - x[i]), worst[i])
            damped[i] = damping[i] * damps
        if halt:
            first = NEVER_LOST
            for i in range(LANES):
                first = min(first, lost_pulse[i])
            if first < NEVER_LOST:
                break
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
                known = step == substep and whole_known
                for i in range(0 if known else LANES):
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
                if known:
                    for k in range(6):
                        for i in range(LANES):
                            lanes[18 + k, i] = kept[k, i]
                elif step == substep:
                    whole_known = True
                    for k in range(6):
                        for i in range(LANES):
                            kept[k, i] = lanes[18 + k, i]
            passed = t + 0.5 * step - pulsed
            part = 0.0
            if passed > gap:  # the next pulse is late
                even = way / passed
                damps = level / (1.0 + (even / roll_off) * (even / roll_off))
                for i in range(LANES):
                    damped[i] = damping[i] * damps
            elif glide > 0.0:
                part = 1.0 - passed / gap
            if fresh or glide > 0.0:
                before = previous % cycle
                asked_a = table_a[row, at]
                asked_b = table_b[row, at]
                if part > 0.0:
                    asked_a = table_a[row, at] + part * (table_a[row, before] - table_a[row, at])
                    asked_b = table_b[row, at] + part * (table_b[row, before] - table_b[row, at])
                for i in range(LANES):
                    amps = par[AMPS, lane + i] * level
                    volts = par[VOLTS, lane + i]
                    wa = amps * asked_a
                    wb = amps * asked_b
                    want_a[i] = wa
                    want_b[i] = wb
                    low_a = lowest if wa > 0.0 else (-1.0 if wa < 0.0 else at_zero)
                    high_a = lowest if wa < 0.0 else (-1.0 if wa > 0.0 else at_zero)
                    low_b = lowest if wb > 0.0 else (-1.0 if wb < 0.0 else at_zero)
                    high_b = lowest if wb < 0.0 else (-1.0 if wb > 0.0 else at_zero)
                    least_a[i] = feedback * volts * low_a + (1.0 - feedback) * wa * par[GAIN, lane + i]
                    most_a[i] = feedback * -volts * high_a + (1.0 - feedback) * wa * par[GAIN, lane + i]
                    least_b[i] = feedback * volts * low_b + (1.0 - feedback) * wb * par[GAIN, lane + i]
                    most_b[i] = feedback * -volts * high_b + (1.0 - feedback) * wb * par[GAIN, lane + i]
                fresh = False
            for i in range(LANES):
                wm = w[i] + half_h * acc[i]
                xm = x[i] + turned * (w[i] + 0.5 * half_h * acc[i])
                turns = np.floor(xm * ONE_TURN + 0.5)
                y = 0.25 * ((xm - turns * TURN_HIGH) - turns * TURN_LOW)
                y2 = y * y
                sine = y - y * y2 * (1 / 6 - y2 * (1 / 120 - y2 * (1 / 5040 - y2 * (1 / 362880 - y2 * (
                    1 / 39916800 - y2 * (1 / 6227020800))))))  # fmt: skip
                cosine = 1.0 - y2 * (0.5 - y2 * (1 / 24 - y2 * (1 / 720 - y2 * (1 / 40320 - y2 * (1 / 3628800 - y2 * (
                    1 / 479001600 - y2 * (1 / 87178291200)))))))  # fmt: skip
                twice = 2.0 * sine * cosine
                rest = 1.0 - 2.0 * sine * sine
                sn = 2.0 * twice * rest
                cs = 1.0 - 2.0 * twice * twice
                ea = -kt[i] * wm * sn
                eb = kt[i] * wm * cs
                # what the drive gives, beyond what the EMF and the resistance take
                base_a = ea + r[i] * ia[i]
                base_b = eb + r[i] * ib[i]
                ua = min(max((want_a[i] - ia[i]) * per_g[i], least_a[i] - base_a), most_a[i] - base_a)
                ub = min(max((want_b[i] - ib[i]) * per_g[i], least_b[i] - base_b), most_b[i] - base_b)
                mean_a = ia[i] + ua * q[i]
                mean_b = ib[i] + ub * q[i]
                torque = kt[i] * (mean_b * cs - mean_a * sn)
                cogging = td[i] * sn * cs * (cs * cs - sn * sn)
                wn = w[i] * slowed[i] + pushed[i] * (torque - cogging - loaded[i] + damped[i] * (even - wm))
                wn = max(wn - d[i], 0.0) + min(wn + d[i], 0.0)
                x[i] = x[i] + turned * (w[i] + wn)
                ia[i] = ia[i] + ua * g[i]
                ib[i] = ib[i] + ub * g[i]
                acc[i] = (wn - w[i]) * per_h
                w[i] = wn
                worst[i] = max(abs(phi - x[i]), worst[i])
            t += step
        for i in range(LANES):
            worst_pulse[i] = pulse if worst[i] > worst_then[i] else worst_pulse[i]
            lost_pulse[i] = min(lost_pulse[i], pulse if worst[i] > TWO_PI else NEVER_LOST)
        if not whole:
            break
        if places[event] != place:
            pulse += 1.0
            gap = end - pulsed
            pulsed = end
            previous = place
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


@partial(jit, parallel=True)
def advance_all(  # type: ignore[no-untyped-def]
    state,
    par,
    now,
    place,
    level,
    row,
    mode,
    pulses,
    pulsed,
    gap,
    previous,
    times,
    places,
    levels,
    rows,
    modes,
    until,
    table_a,
    table_b,
    substep,
    halt,
):
    """`advance_lanes` for every group of lanes in `state`. The time reached is that of each group."""
    groups = state.shape[1] // LANES
    ends = [0] * groups
    for group in prange(groups):
        ends[group] = advance_lanes(state, par, group * LANES, now, place, level, row, mode, pulses, pulsed,
                                    gap, previous, times, places, levels, rows, modes, until, table_a, table_b,
                                    substep, halt)  # fmt: skip
    return ends[0]
