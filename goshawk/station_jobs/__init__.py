"""Background work that the ground station's page offers; a new kind is one new file and its line here."""

from goshawk.station_jobs import identify, map_images, plan_batch

KINDS = (plan_batch.KIND, identify.KIND, map_images.KIND)
