# The same with a real flight of a nano quadrotor (45 g), whose clocks and units were made wrong.
# You have: flight.csv, and what the vehicle's page says.
goshawk vehicle new nano.toml --mass 0.045 --arm 0.05 --prop-diameter 0.055 --hover-rpm 16600
goshawk log flight.csv --draft-columns columns.toml
goshawk log flight.csv --columns columns.toml --vehicle nano.toml --fix --out flight.parquet
goshawk log flight.parquet --vehicle nano.toml --report flight.html
