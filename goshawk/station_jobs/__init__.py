"""Background work that the ground station's page offers; a new kind is one new file and its line here."""

from goshawk.station_jobs import (
    compare,
    diagnose,
    example,
    identify,
    import_shape,
    look_again,
    map_images,
    new_vehicle,
    next_flight,
    plan_batch,
    preflight,
    try_effect,
)

KINDS = (
    plan_batch.KIND,
    preflight.KIND,
    identify.KIND,
    map_images.KIND,
    import_shape.KIND,
    look_again.KIND,
    new_vehicle.KIND,
    new_vehicle.EXAMPLE,
    example.KIND,
    compare.KIND,
    diagnose.KIND,
    try_effect.KIND,
    next_flight.KIND,
)
