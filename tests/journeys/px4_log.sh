# A PX4 log to a vehicle file made from its own parameters, and from there to a fitted model.
# You have: flight.ulg, a kitchen scale, and the propeller's size.
goshawk vehicle new quad.toml --from flight.ulg --mass 0.70 --prop-diameter 0.127 --hover-rpm 9085
goshawk log flight.ulg --vehicle quad.toml --report flight.html
goshawk identify flight.ulg --vehicle quad.toml --out fitted.toml --hold-unidentifiable
goshawk vehicle show fitted.toml
