"""An answer as plain data: what `detent tune --json` prints, and what the Motion page shows."""

from typing import Any

from detent.motors.variants import QUANTITIES
from detent.tuner.spaces import Profile
from detent.tuner.tune import Rival, Tuned

SHOWN = {"torque_constant": "torque"}
"""Quantities that are called otherwise where people read them."""


def facts(tuned: Tuned) -> dict[str, Any]:
    """Everything that is known of the answer; JSON has a form for all of it. Times in s, steps as they were asked."""
    task, found = tuned.task, tuned.found
    check = found.check
    return {
        "model": task.model, "motor": task.rig.motor.name, "complete": found.whole,
        "settings": dict(found.profile.values), "options": dict(found.profile.options),
        "commands": list(found.profile.settings),
        "moves": [
            {"steps": move.steps, "weight": move.weight, "go": found.profile.go(move.steps), "time_s": time,
             "bound_s": {"nominal": nominal, "worst": worst}}
            for move, time, nominal, worst in zip(task.moves, found.times, *tuned.bound, strict=True)
        ],
        "time_s": found.time, "bound_s": tuned.bound_time, "ratio": tuned.ratio,
        "check": {"variants": check.variants, "lost": check.lost, "corners": check.corners,
                  "corners_lost": check.corners_lost, "looks": check.looks, "rate_below": check.bound,
                  "survived": check.met, "words": str(check)},
        "hand": _rival(tuned.hand), "hand_safe": _rival(tuned.safe_hand),
        "models": [model._asdict() for model in tuned.models], "fails_first": [one._asdict() for one in tuned.fails],
        "ranges": {name: list(ends) for name, ends in zip(QUANTITIES, task.ranges, strict=True)},
        "both_ways": task.both_ways, "seed": task.seed,
    }  # fmt: skip


def option_lines(profile: Profile) -> list[str]:
    """The options that a profile needs and no command sets, as a cell file has them."""
    return [
        f'{name} = "{value}"' for name, value in profile.options.items() if name != "step_size" or not profile.before
    ]


def fails_words(tuned: Tuned, most: int = 4) -> str:
    """What fails first, the nearest first: voltage x0.84, inertia x1.42."""
    return ", ".join(f"{SHOWN.get(one.quantity, one.quantity)} x{one.factor:.2f}" for one in tuned.fails[:most])


def models_words(tuned: Tuned) -> str:
    """How many variants lose the moves where the motor is modelled otherwise."""
    return ", ".join(f"{one.name} {one.lost}" for one in tuned.models)


def _rival(rival: Rival | None) -> dict[str, Any] | None:
    if rival is None:
        return None
    return {"settings": dict(rival.profile.values), "options": dict(rival.profile.options),
            "commands": list(rival.profile.settings), "moves_s": list(rival.times), "time_s": rival.time,
            "variants": rival.tried, "lost": rival.lost, "words": str(rival.profile)}  # fmt: skip
