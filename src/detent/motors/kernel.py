"""The equations, stepped: one flat function in plain arithmetic.

It runs as it stands (slowly), compiled by numba (`engine`), and as a thread of a GPU: it calls nothing but `floor`,
and has its own sine, cosine and exponential, so that all of them give the same numbers, bit for bit where the
hardware rounds alike.

Phase frame; x = p theta is the electrical angle::

    L di/dt = v - R i - e        e = Kt w (-sin x, cos x)
    J dw/dt = Kt (ib cos x - ia sin x) - Td sin 4x - B w - Tc sgn w - TL(t, theta) + D (w_pulses - w)

D = D0 k / (1 + (w_pulses / w1)**2) is the damping about the speed of the pulses (`damping`), k the factor on the
current: windings without current damp nothing. That speed is the way of the
last pulse over the time it took since the one before; when no pulse has come for longer, over the time that has passed.

*Exponential midpoint*: over one substep the EMF is that of the predicted middle, the winding is solved exactly, and
the rotor gets the torque of the mean current; Coulomb friction sticks exactly. Substeps are `h` long from the last
change of excitation on, the one before the next change is what is left: no pulse falls into a substep, and where a
substep ends depends on nothing but the changes. So a run may be cut anywhere, and goes on exactly as if it had not
been.
"""

from math import floor

# s, the state in floats
X, W, IA, IB, ACC, LEVEL, WORST, ELECTRIC, COPPER, MECHANIC, X_NEXT, W_NEXT, ACC_NEXT = range(13)
FLOATS = 13
# n, the state in integers
# (PULSED: time of the last pulse, GAP: since the one before, FROM: the place before it)
(NOW, PLACE, ROW, MODE, PULSES, WORST_PULSE, LOST_PULSE, PULSED, GAP, FROM, STEP, TRACED, NEXT_TRACE,
 TAKEN) = range(14)  # fmt: skip
INTEGERS = 14
# par, what does not change
(R, L, KT, TEETH, J, B, TC, TL, TD, VOLTS, AMPS, PITCH, OFFSET, T_START, T_STEP, P_START, P_STEP, SAMPLE,
 GAIN, DAMPING, ROLL_OFF, FALL, GLIDE) = range(23)  # fmt: skip
PARAMETERS = 23
# a row of the trace
T_COLUMN, X_COLUMN, W_COLUMN, IA_COLUMN, IB_COLUMN, PHI_COLUMN = range(6)
COLUMNS = 6

DONE, CROSSED, BROKEN = range(3)  # what `advance` returns

TURN_HIGH = 6.2831853069365025  # the first 33 bits of 2 pi
TURN_LOW = 2.4308402026024769e-10
ONE_TURN = 0.15915494309189535
TWO_PI = 6.283185307179586
FAR = 1 << 62
LONG_AGO = 1 << 60  # ns, of the pulse before the first


def advance(  # type: ignore[no-untyped-def]
    s,
    n,
    times,
    places,
    levels,
    rows,
    modes,
    until,
    table_a,
    table_b,
    par,
    by_time,
    by_position,
    low,
    high,
    trace,
    substep,
):
    """Go on from the state (s, n): through the changes of excitation at `times` that are not after `until`.

    Change number k sets the place in the winding table, the factor on the current, the row of the table (its
    stepping mode) and the decay. Behind them, whole substeps as far as they fit before `until`. Stops before a
    substep that reaches the electrical angle `low` or `high` (CROSSED; the state is the one before it, the one behind
    it is in X_NEXT, W_NEXT, ACC_NEXT, its length in STEP). BROKEN when the speed is no number any more. Angles in
    electrical radians, times in ns.
    """
    x = float(s[X])
    w = float(s[W])
    ia = float(s[IA])
    ib = float(s[IB])
    acc = float(s[ACC])
    level = float(s[LEVEL])
    worst = float(s[WORST])
    electric = float(s[ELECTRIC])
    copper = float(s[COPPER])
    mechanic = float(s[MECHANIC])
    t = int(n[NOW])
    place = int(n[PLACE])
    row = int(n[ROW])
    mode = int(n[MODE])
    pulses = int(n[PULSES])
    worst_pulse = int(n[WORST_PULSE])
    lost_pulse = int(n[LOST_PULSE])
    traced = int(n[TRACED])
    next_trace = int(n[NEXT_TRACE])

    r = float(par[R])
    ell = float(par[L])
    kt = float(par[KT])
    teeth = float(par[TEETH])
    j = float(par[J])
    b = float(par[B])
    tc = float(par[TC])
    constant = float(par[TL])
    td = float(par[TD])
    volts = float(par[VOLTS])
    amps = float(par[AMPS])
    pitch = float(par[PITCH])
    offset = float(par[OFFSET])
    cycle = table_a.shape[1]
    many_times = len(by_time)
    many_places = len(by_position)
    many_traces = len(trace)
    sample = int(par[SAMPLE])
    gain = float(par[GAIN])  # V that a voltage drive gives for an ampere asked of it
    damping = float(par[DAMPING])  # Nm s/rad
    roll_off = float(par[ROLL_OFF])  # rad/s
    fall = float(par[FALL])  # of a mixed decay: the least voltage against a current, as a part of the supply
    glide = float(par[GLIDE])  # 1: the drive passes from place to place in the time of a pulse
    pulsed = int(n[PULSED])
    gap = int(n[GAP])
    previous = int(n[FROM])
    half_teeth = 0.5 * teeth

    count = len(times)
    event = 0
    code = 0
    cached = -1
    h = 0.0
    g = 0.0
    q = 0.0
    b_half = 0.0
    h_over_j = 0.0
    d = 0.0
    per_g = 0.0
    per_h = 0.0
    slowed = 0.0
    pushed = 0.0
    half_h = 0.0
    turned = 0.0
    while True:
        end = FAR
        if event < count:
            end = int(times[event])
        whole = end <= until
        stop = end
        if not whole:
            stop = until
        phi = offset + place * pitch
        at = place % cycle
        want_a = amps * level * float(table_a[row, at])
        want_b = amps * level * float(table_b[row, at])
        way = (place - previous) * pitch / teeth * 1e9
        even = way / gap
        damps = level / (1.0 + (even / roll_off) * (even / roll_off))
        delta = abs(phi - x)
        if delta > worst:
            worst = delta
            worst_pulse = pulses
        if delta > TWO_PI and lost_pulse < 0:
            lost_pulse = pulses
        while t < stop:
            step = stop - t
            if step >= substep:
                step = substep
            elif not whole:
                break
            if step != cached:
                cached = step
                h = step * 1e-9
                z = h * r / ell
                # (exp(-z) - 1 + z) / z**2
                phi2 = 0.5 - z * (1 / 6 - z * (1 / 24 - z * (1 / 120 - z * (1 / 720 - z * (1 / 5040 - z * (
                    1 / 40320 - z * (1 / 362880 - z * (1 / 3628800 - z / 39916800))))))))  # fmt: skip
                g = h / ell * (1.0 - z * phi2)
                q = h / ell * phi2
                b_half = h * b / (2.0 * j)
                h_over_j = h / j
                d = h * tc / j
                per_g = 1.0 / g
                per_h = 1.0 / h
                slowed = (1.0 - b_half) / (1.0 + b_half)
                pushed = h_over_j / (1.0 + b_half)
                half_h = 0.5 * h
                turned = half_teeth * h
            passed = t + 0.5 * step - pulsed
            if passed > gap:  # the next pulse is late
                even = way / passed
                damps = level / (1.0 + (even / roll_off) * (even / roll_off))
            elif glide > 0.0:
                before = previous % cycle
                part = 1.0 - passed / gap
                want_a = (
                    amps
                    * level
                    * (float(table_a[row, at]) + part * (float(table_a[row, before]) - float(table_a[row, at])))
                )
                want_b = (
                    amps
                    * level
                    * (float(table_b[row, at]) + part * (float(table_b[row, before]) - float(table_b[row, at])))
                )
            if glide > 0.0 and passed > gap:
                want_a = amps * level * float(table_a[row, at])
                want_b = amps * level * float(table_b[row, at])
            # the middle of the substep, predicted
            wm = w + half_h * acc
            xm = x + turned * (w + 0.5 * half_h * acc)
            turns = float(floor(xm * ONE_TURN + 0.5))
            y = 0.25 * ((xm - turns * TURN_HIGH) - turns * TURN_LOW)
            y2 = y * y
            sine = y - y * y2 * (1 / 6 - y2 * (1 / 120 - y2 * (1 / 5040 - y2 * (1 / 362880 - y2 * (
                1 / 39916800 - y2 * (1 / 6227020800))))))  # fmt: skip
            cosine = 1.0 - y2 * (0.5 - y2 * (1 / 24 - y2 * (1 / 720 - y2 * (1 / 40320 - y2 * (1 / 3628800 - y2 * (
                1 / 479001600 - y2 * (1 / 87178291200)))))))  # fmt: skip
            # of a quarter of the angle; doubled twice
            twice = 2.0 * sine * cosine
            rest = 1.0 - 2.0 * sine * sine
            sn = 2.0 * twice * rest
            cs = 1.0 - 2.0 * twice * twice
            ea = -kt * wm * sn
            eb = kt * wm * cs
            # what the drive gives, beyond what the EMF and the resistance take
            base_a = ea + r * ia
            base_b = eb + r * ib
            if mode == 2:
                ua = want_a * gain - base_a
                ub = want_b * gain - base_b
            else:
                least_a = -volts
                most_a = volts
                least_b = -volts
                most_b = volts
                if mode == 1 or mode == 3:
                    lowest = 0.0
                    if mode == 3:
                        lowest = fall * volts
                    if want_a > 0.0:
                        least_a = lowest
                    elif want_a < 0.0:
                        most_a = -lowest
                    else:
                        least_a = min(lowest, 0.0)
                        most_a = -least_a
                    if want_b > 0.0:
                        least_b = lowest
                    elif want_b < 0.0:
                        most_b = -lowest
                    else:
                        least_b = min(lowest, 0.0)
                        most_b = -least_b
                ua = min(max((want_a - ia) * per_g, least_a - base_a), most_a - base_a)
                ub = min(max((want_b - ib) * per_g, least_b - base_b), most_b - base_b)
            # the windings, exactly
            mean_a = ia + ua * q
            mean_b = ib + ub * q
            torque = kt * (mean_b * cs - mean_a * sn)
            loaded = constant
            if many_times > 1:
                place_in = min(
                    max((t * 1e-9 + 0.5 * h - float(par[T_START])) / float(par[T_STEP]), 0.0), many_times - 1.0
                )
                first = min(int(place_in), many_times - 2)
                rest = place_in - first
                loaded += float(by_time[first]) + rest * (float(by_time[first + 1]) - float(by_time[first]))
            if many_places > 1:
                place_in = min(max((xm / teeth - float(par[P_START])) / float(par[P_STEP]), 0.0), many_places - 1.0)
                first = min(int(place_in), many_places - 2)
                rest = place_in - first
                loaded += float(by_position[first]) + rest * (float(by_position[first + 1]) - float(by_position[first]))
            cogging = td * 4.0 * sn * cs * (cs * cs - sn * sn)
            wn = w * slowed + pushed * (torque - cogging - loaded + damping * damps * (even - wm))
            wn = max(wn - d, 0.0) + min(wn + d, 0.0)
            xn = x + turned * (w + wn)
            if not abs(wn) < 1e7:
                code = 2
                break
            if xn <= low or xn >= high:
                s[X_NEXT] = xn
                s[W_NEXT] = wn
                s[ACC_NEXT] = (wn - w) * per_h
                n[STEP] = step
                code = 1
                break
            da = ua * g
            db = ub * g
            electric += h * ((ua + base_a) * mean_a + (ub + base_b) * mean_b)
            copper += h * r * (mean_a * mean_a + mean_b * mean_b + (da * da + db * db) * (1 / 12))
            mechanic += half_h * torque * (w + wn)
            ia += da
            ib += db
            acc = (wn - w) * per_h
            w = wn
            x = xn
            t += step
            delta = abs(phi - x)
            if delta > worst:
                worst = delta
                worst_pulse = pulses
            if delta > TWO_PI and lost_pulse < 0:
                lost_pulse = pulses
            if traced < many_traces and t >= next_trace:
                trace[traced, 0] = t
                trace[traced, 1] = x
                trace[traced, 2] = w
                trace[traced, 3] = ia
                trace[traced, 4] = ib
                trace[traced, 5] = phi
                traced += 1
                next_trace = t + sample
        if code != 0 or not whole:
            break
        if int(places[event]) != place:
            pulses += 1
            gap = end - pulsed
            pulsed = end
            previous = place
        place = int(places[event])
        level = float(levels[event])
        row = int(rows[event])
        mode = int(modes[event])
        event += 1

    s[X] = x
    s[W] = w
    s[IA] = ia
    s[IB] = ib
    s[ACC] = acc
    s[LEVEL] = level
    s[WORST] = worst
    s[ELECTRIC] = electric
    s[COPPER] = copper
    s[MECHANIC] = mechanic
    n[NOW] = t
    n[PLACE] = place
    n[ROW] = row
    n[MODE] = mode
    n[PULSES] = pulses
    n[WORST_PULSE] = worst_pulse
    n[LOST_PULSE] = lost_pulse
    n[PULSED] = pulsed
    n[GAP] = gap
    n[FROM] = previous
    n[TRACED] = traced
    n[NEXT_TRACE] = next_trace
    n[TAKEN] = event
    return code
