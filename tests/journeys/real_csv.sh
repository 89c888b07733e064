# The same with a real flight of a nano quadrotor (45 g), whose clocks and units were made wrong.
# You have: flight.csv, and what the vehicle's page says.
goshawk vehicle new nano.toml --mass 0.045 --arm 0.05 --prop-diameter 0.055 --hover-rpm 16600
goshawk log draft-columns flight.csv --out columns.toml
goshawk log fix flight.csv --columns columns.toml --vehicle nano.toml --out flight.parquet
goshawk log check flight.parquet --vehicle nano.toml --report flight.html
