"""How a verb is asked to write over a file that is there."""

from typing import Annotated

from cyclopts import Parameter

# Many programs say --force, and so did these verbs once. Where a load may have a force (see `rig`), that is its name,
# and only --overwrite asks.
Overwrite = Annotated[bool, Parameter(name=("--overwrite", "--force"), negative=())]
