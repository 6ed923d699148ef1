"""The grammar needs lark, which the product itself does not import: without it these tests are left out."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("lark") else ["test_modules.py", "test_fletcher.py"]
