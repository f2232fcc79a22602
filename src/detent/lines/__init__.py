"""Serial lines: who hears whom, and when.

`line.Line` joins one host and its units the way point-to-point and multipoint wiring do. Lines know characters
and their times, and nothing of what they mean.
"""
