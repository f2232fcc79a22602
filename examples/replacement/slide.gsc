; What the EEPROM of the old module held: there and back, each time UI1 closes and opens.
        S20     ; start-stop speed 200 steps/s
        T150    ; slew speed 1500 steps/s
        R60     ; ramps of 60 steps
        G+1     ; on, until UI1 is 0
        G0      ; and back to the home position
