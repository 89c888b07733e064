# Two logs of a Crazyflie's SD card, with gyro, accelerometer and motor commands but no pose, to a fitted vehicle.
# You have: throttle (log10) and turns (log15), a kitchen scale, a ruler, and the propeller's size (46 mm).
goshawk vehicle new quad.toml --mass 0.027 --arm 0.04 --prop-diameter 0.046
goshawk log fix throttle --vehicle quad.toml --out throttle.parquet
goshawk log fix turns --vehicle quad.toml --out turns.parquet
goshawk identify throttle.parquet turns.parquet --vehicle quad.toml --out fitted.toml --report fit.html
