# A CSV of Crazyflie's log variables to a better vehicle.
# You have: flight.csv, a kitchen scale, a ruler, and the propeller's size (5 inches).
goshawk vehicle new quad.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
goshawk log draft-columns flight.csv --out columns.toml
goshawk log fix flight.csv --columns columns.toml --vehicle quad.toml --out flight.parquet
goshawk diagnose flight.parquet --vehicle quad.toml --auto --out better.toml --report better.html
