# Your own vehicle, from its data sheet to a checked flight plan.
# You have: a kitchen scale, a ruler, the propeller's size (5 inches), a map folder `room`, and waypoints.csv.
goshawk vehicle new quad.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127 --hover-rpm 9100
goshawk vehicle show quad.toml
goshawk init my-room --vehicle quad.toml --map room
goshawk plan waypoints.csv --map my-room/map --vehicle my-room/vehicle.toml --out my-room/trajectories/first.json
goshawk check my-room/trajectories/first.json --map my-room/map --vehicle my-room/vehicle.toml
