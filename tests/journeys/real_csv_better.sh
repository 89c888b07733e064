# A real flight of a nano quadrotor as its recorder wrote it, to a better vehicle, judged on another flight.
# You have: flight.csv, other.csv, a scale, a ruler, and the propeller's size (55 mm).
goshawk vehicle new nano.toml --mass 0.045 --arm 0.05 --prop-diameter 0.055
goshawk log draft-columns flight.csv --out columns.toml
goshawk log fix flight.csv --columns columns.toml --vehicle nano.toml --out flight.parquet
goshawk diagnose flight.parquet --vehicle nano.toml --auto --out better.toml --report better.html
goshawk log fix other.csv --columns columns.toml --vehicle nano.toml --out other.parquet
goshawk compare other.parquet --vehicle nano.toml --vehicle better.toml --protocol h50
