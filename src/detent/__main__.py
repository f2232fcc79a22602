"""``python -m detent``: the same as the command ``detent``."""

from detent.cli import command

if __name__ == "__main__":
    command()
