# An ArduPilot log to a better vehicle; motors are put into the order of the vehicle's rotors.
# You have: flight.bin, a kitchen scale, a ruler, and the propeller's size (5 inches).
goshawk vehicle new quad.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
goshawk log fix flight.bin --vehicle quad.toml --out flight.parquet
goshawk diagnose flight.parquet --vehicle quad.toml --auto --out better.toml --report better.html
