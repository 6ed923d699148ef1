"""deploy/docs_site.py, the hooks of mkdocs.yml, as a module."""

from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

from tests.structure import ROOT


def docs_site() -> Any:
    """The module; its pages need the product, not mkdocs."""
    spec = spec_from_file_location("docs_site", ROOT / "deploy" / "docs_site.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
