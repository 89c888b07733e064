# A PX4 log to a better vehicle: a file made from the log's own parameters, and the effect that it lacks.
# You have: flight.ulg, a kitchen scale, and the propeller's size (5 inches).
goshawk vehicle new quad.toml --import flight.ulg --mass 0.72 --prop-diameter 0.127
goshawk log fix flight.ulg --vehicle quad.toml --out flight.parquet
goshawk diagnose flight.parquet --vehicle quad.toml --auto --out better.toml --report better.html
