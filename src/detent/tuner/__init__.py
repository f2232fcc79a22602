"""The fastest settings of a controller with which a motor and its load lose no step.

`task.Task` is what is asked for, `search.tune` finds it and says how it is known. A piece of the work is a
`judge.Job`: a point of the grid and the numbers of some variants; what it answers hangs on nothing else, so that
the work may be divided at will, over processes and machines.
"""
