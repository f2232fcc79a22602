"""A cell in real time: the only package that reads the wall clock, and the endpoints that clients connect to."""
