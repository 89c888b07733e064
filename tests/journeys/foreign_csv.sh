# A CSV log of somebody else's recorder, with other units and a late rotor clock, to a fitted vehicle.
# You have: flight.csv, and the data sheet of the vehicle that flew.
goshawk vehicle new quad.toml --mass 0.70 --arm 0.125 --prop-diameter 0.127 --hover-rpm 9085
goshawk log flight.csv --draft-columns columns.toml
goshawk log flight.csv --columns columns.toml --vehicle quad.toml --report before.html
goshawk log flight.csv --columns columns.toml --vehicle quad.toml --fix --out flight.parquet
goshawk log flight.parquet --vehicle quad.toml --report after.html
goshawk identify flight.parquet --vehicle quad.toml --out fitted.toml --hold-unidentifiable
goshawk compare flight.parquet --vehicle quad.toml --vehicle fitted.toml
