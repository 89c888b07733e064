"""Background work that the ground station's page offers; a new kind is one new file and its line here."""

from goshawk.station_jobs import (
    compare,
    diagnose,
    identify,
    look_again,
    map_images,
    next_flight,
    plan_batch,
    try_effect,
)

KINDS = (
    plan_batch.KIND,
    identify.KIND,
    map_images.KIND,
    look_again.KIND,
    compare.KIND,
    diagnose.KIND,
    try_effect.KIND,
    next_flight.KIND,
)
