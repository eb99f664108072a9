"""Few starts in a process that a test starts with this folder in PYTHONPATH, and in the processes that it starts.

Python imports a module of this name before all others. The constants are changed as soon as the package is imported,
so that a process that does not need it does not wait for it.
"""

import importlib.machinery
import sys

from starts import FEW


class FewStarts(importlib.machinery.PathFinder):
    """Finds the modules with the constants, and changes these once the module has been run."""

    @classmethod
    def find_spec(cls, fullname, path=None, target=None):
        if fullname not in FEW:
            return None
        spec = super().find_spec(fullname, path, target)
        run = spec.loader.exec_module

        def run_and_change(module):
            run(module)
            vars(module).update(FEW[fullname])

        spec.loader.exec_module = run_and_change
        return spec


sys.meta_path.insert(0, FewStarts)
