"""What rigs add to the daemon."""

from daemon.api.extension import Extension, Rebuilt, rebuilt_of
from daemon.application import Application
from extensions.rigs.rig_sensors import STORED_RIGS, RigSensors
from extensions.rigs.routes import StoredRig, router


async def _rebuild(app: Application, rig_id: str) -> Rebuilt:
    return rebuilt_of(201, StoredRig.of_record(await app.store.documents(STORED_RIGS).get(rig_id)), f"/rigs/{rig_id}")


RIGS = Extension("rigs", routers=(router,), links={"rigs": "/rigs"}, rebuilders={"rig": _rebuild}, sensors=RigSensors)
