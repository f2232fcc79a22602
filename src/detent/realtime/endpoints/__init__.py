"""What clients connect to: a pseudo-terminal, a TCP port, a serial port."""
