"""Units that the workbench talks to as their host: real ones at a port, and those of the cell beside them."""
