"""SGS-THOMSON GS-C200 and GS-C200S, intelligent stepper motor controller modules (datasheet of 1994).

`pins` are the connector, `link` the frames on the serial line, `commands` the one table of the language,
`program` the 119 bytes of program memory, `firmware` what the module does with all of it. Start reading at
`firmware.GsC200`; what the datasheet leaves open is settled in docs/controllers/gsc200.md.
"""
