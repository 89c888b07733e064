# Your own waypoints to a flown log, in the simulated vehicle.
# You have: a map folder `room`, a vehicle file `quad.toml`, and waypoints.csv with columns x_m,y_m,z_m.
goshawk sitl --vehicle quad.toml --at 0.8,0.8,0 --port 14561 --key link.key &
goshawk plan waypoints.csv --map room --vehicle quad.toml --out lap.json
goshawk upload lap.json --url udp://127.0.0.1:14561 --key link.key
goshawk fly --trajectory lap.json --url udp://127.0.0.1:14561 --key link.key --out lap.parquet
goshawk log check lap.parquet --vehicle quad.toml --report lap.html
kill %1
