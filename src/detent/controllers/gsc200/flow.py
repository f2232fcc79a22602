"""Where a running program goes next: loops, jumps, the guard (datasheet, commands L, U, j, jc).

Loops (settled in docs/controllers/gsc200.md): ``L0`` marks, ``L<n>`` runs the body n times in all. Marks form
a stack, so loops nest. Meeting the same ``L0`` again, by a jump or in the next round of an outer loop, drops
it and the marks above it. An ``L<n>`` without a mark repeats from address 0.
"""

from detent.controllers.gsc200.commands import Instruction, Op
from detent.controllers.gsc200.program import Step


class Flow:
    """The program counter, the stack of loop marks, and the input that guards the whole program."""

    __slots__ = ("_marks", "address", "guard", "jumped")

    def __init__(self) -> None:
        self.address = 0
        self.guard = 0  # user input of a U as first instruction; 0: none
        self.jumped = False  # `address` is where a j or jc leads: an instruction must start there
        self._marks: list[list[int]] = []  # [address that owns it, where the body begins, rounds begun]

    def restart(self) -> None:
        """Go to address 0 as a fresh program: no marks, no guard."""
        self.address = self.guard = 0
        self.jumped = False
        self._marks.clear()

    def rounds(self) -> list[tuple[int, int]]:
        """The marks, outermost first: the address of the L that owns each, and the rounds begun."""
        return [(owner, begun) for owner, _, begun in self._marks]

    def follow(self, step: Step, inputs: int) -> None:
        """Set `address` to where the program goes after `step`, with the user inputs weighted 1, 2, 4."""
        self.address = step.next
        self.jumped = False
        instruction = step.instruction
        match instruction.op:
            case Op.LOOP:
                self._loop(step, instruction)
            case Op.JUMP:
                self.address, self.jumped = instruction.value, True
            case Op.JUMP_IF:
                if inputs == instruction.other:
                    self.address, self.jumped = instruction.value, True
            case Op.UNTIL:
                if step.address == 0:
                    self.guard = instruction.value
                elif inputs >> (instruction.value - 1) & 1:
                    self.address = 0
                    self._marks.clear()

    def _loop(self, step: Step, instruction: Instruction) -> None:
        marks = self._marks
        if instruction.value == 0:
            self._drop(step.address)
            marks.append([step.address, step.next, 1])
            return
        # The innermost mark is the body's, unless it stands for another L<n> without a mark of its own.
        if not marks or (marks[-1][1] == 0 and marks[-1][0] != step.address):
            self._drop(step.address)
            marks.append([step.address, 0, 1])
        mark = marks[-1]
        if mark[2] < instruction.value:
            mark[2] += 1
            self.address = mark[1]
        else:
            marks.pop()

    def _drop(self, owner: int) -> None:
        """Drop the mark of the instruction at `owner` and all above it, if it is there."""
        for depth, mark in enumerate(self._marks):
            if mark[0] == owner:
                del self._marks[depth:]
                return
