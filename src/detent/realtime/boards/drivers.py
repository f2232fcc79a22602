"""Driver chips: the settings that a controller commands of its power stage, written to registers and read back."""

from detent.controllers.device import Stage


class Driver:
    """A driver chip on a board; found as `board.drivers[name]`. What became of it comes as DriverSet or DriverFault."""

    name: str

    def command(self, stage: Stage) -> None:
        """Set the chip as `stage` says, as soon as the chip can be reached; the last command counts.

        SetupProblem, before anything is sent, where the chip cannot do it.
        """
        raise NotImplementedError
