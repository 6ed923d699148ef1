"""What sweeps of line profilers add to the daemon."""

from daemon.api.extension import Extension
from daemon.application import Application
from extensions.sweeps.routes import router
from extensions.sweeps.service import SweepService


def _service(app: Application) -> SweepService:
    return SweepService(app.cell, app.store, app.scans, app.service_workers, app.clock, app.new_id)


SWEEPS = Extension("sweeps", routers=(router,), services=(_service,))
