"""A firmware's count of the steps of one stepper, as the host has to read it.

It counts up to 2^30 steps away from where it was configured; behind that, what it answers runs back again. Where it is
stopped, by a trigger or a shutdown, it takes what it answers for its count from then on. So each answer may be one of
two counts, and the one that is meant is near what was sent. Only within some steps of that end nobody can tell.
"""

from typing import NamedTuple

END = 1 << 30  # steps away from where it was configured: from here on the count runs back
DOUBT = 1 << 16  # more steps than are ever under way


class Count(NamedTuple):
    """`told` is the count behind every step that was sent, without an end; `behind` it less what is answered."""

    told: int = 0
    behind: int = 0

    def sent(self, steps: int) -> "Count":
        """So many steps more, negative where DIR is low."""
        return self._replace(told=self.told + steps)

    def whole(self, answer: int) -> int:
        """The count that an answer means: of those that are answered so, the nearest to what was sent."""
        return min(self._candidates(answer), key=lambda whole: abs(whole - self.told))

    def doubtful(self, answer: int) -> bool:
        """Whether it may be another one, too: steps that were sent may not have been made."""
        one, other = (abs(whole - self.told) for whole in self._candidates(answer))
        return one != other and max(one, other) < DOUBT

    def found(self, answer: int, *, stopped: bool) -> "Count":
        """Behind the answer of a firmware that makes no step any more; `stopped`: by a trigger or a shutdown."""
        whole = self.whole(answer)
        return Count(whole, whole - answer if stopped else self.behind)

    def _candidates(self, answer: int) -> tuple[int, int]:
        return tuple(  # type: ignore[return-value]
            self.behind + found + (self.told - self.behind - found + 2 * END) // (4 * END) * 4 * END
            for found in (answer, 2 * END - answer)
        )
