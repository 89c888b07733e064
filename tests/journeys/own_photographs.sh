# Photographs of one camera with an unknown lens, to a map.
# You have: a folder `photos`, and the length of the way that the camera was carried (6.69 m).
goshawk camera new photos --out camera.toml
goshawk map build photos --camera camera.toml --length 6.69 --out room
goshawk init my-room --map room
