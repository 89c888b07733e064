# A ROS 2 recording to a better vehicle.
# You have: the folder flight_bag, a kitchen scale, a ruler, and the propeller's size (5 inches).
goshawk vehicle new quad.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
goshawk log draft-columns flight_bag --out topics.toml
goshawk log fix flight_bag --columns topics.toml --vehicle quad.toml --out flight.parquet
goshawk diagnose flight.parquet --vehicle quad.toml --auto --out better.toml --report better.html
