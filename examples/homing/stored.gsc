; What the EEPROM holds. S comes first: homing at power-on runs at this speed.
        S20     ; start-stop speed 200 steps/s
        T150    ; slew speed 1500 steps/s
        R60     ; ramps of 60 steps
        G+2     ; on, until the sensor on UI2 is 0, then ramp down
        D5      ; 0.5 s
        G0      ; back to the home position
