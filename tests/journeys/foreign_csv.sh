# A CSV log of somebody else's recorder, with other units and a late rotor clock, to a fitted vehicle.
# You have: flight.csv, and the data sheet of the vehicle that flew.
goshawk vehicle new quad.toml --mass 0.70 --arm 0.125 --prop-diameter 0.127 --hover-rpm 9085
goshawk log draft-columns flight.csv --out columns.toml
goshawk log fix flight.csv --columns columns.toml --vehicle quad.toml --out flight.parquet
goshawk log check flight.parquet --vehicle quad.toml --report after.html
goshawk identify flight.parquet --vehicle quad.toml --out fitted.toml
goshawk compare flight.parquet --vehicle quad.toml --vehicle fitted.toml
