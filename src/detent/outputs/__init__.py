"""What is made of a recording: waveforms (VCD, sigrok), arrays, figures; and files that are whole or absent."""
