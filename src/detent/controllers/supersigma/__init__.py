"""The SUPERSIGMA drive: one stepping motor's 8748 with its 8253 on the MICROBUS (R. Cassinis, Milan Polytechnic).

`pins` are the signals of the board, `link` the messages on the bus, `commands` the one table of op-codes, `program`
what is burnt into the EPROM (above all the table of differences), `motion` the movements, `firmware` what the drive
does with all of it. Start reading at `firmware.Supersigma`; what the paper leaves open is settled in
docs/controllers/supersigma.md.
"""
