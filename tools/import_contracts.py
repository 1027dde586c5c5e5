"""Import-linter contract: compiled kernels import only kernels, ``core`` and ``geometry``."""

from typing import Any

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


class KernelsContract(Contract):
    """Allow modules below ``kernels`` to import only each other and named packages."""

    root: Any = fields.StringField()
    allowed: Any = fields.ListField(subfield=fields.StringField())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Return the imports that leave the allowed packages."""
        modules = graph.find_descendants(self.root)
        kernels = [name for name in modules if ".kernels." in name]
        faults = sorted(
            f"{name} imports {target}"
            for name in kernels
            for target in graph.find_modules_directly_imported_by(name)
            if target.startswith("app.") and not self._may_import(target)
        )
        return ContractCheck(kept=bool(kernels) and not faults, metadata={"faults": faults})

    def _may_import(self, target: str) -> bool:
        return ".kernels." in target or target.startswith(tuple(self.allowed))

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Print the imports that are not allowed."""
        for fault in check.metadata["faults"]:
            output.print_error(fault)
