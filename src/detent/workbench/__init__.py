"""The workbench: a cell, its programs, lines and signals in a browser. The cell runs in a process of its own."""
