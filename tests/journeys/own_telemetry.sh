# A log of `goshawk fly` to a better vehicle.
# You have: lap.parquet, a kitchen scale, a ruler, and the propeller's size (5 inches).
goshawk vehicle new quad.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
goshawk log check lap.parquet --vehicle quad.toml --report lap.html
goshawk diagnose lap.parquet --vehicle quad.toml --auto --out better.toml --report better.html
