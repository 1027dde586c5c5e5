"""Compilation of kernels: with an entry for Python, or as a part of other kernels.

numba compiles each function as if Python and C called it: it writes code that unpacks all
arguments, optimises the function together with all functions that it calls, and emits machine
code. A caller uses none of this: it links the intermediate code of its callees and optimises
it again. :class:`Kernel` therefore compiles a kernel that another kernel calls as intermediate
code only, and with an entry and machine code when Python calls it.

Kernels with ``inline="always"`` are inserted as numba's intermediate representation, which is
computed once per kernel instead of at every call.
"""

import copy
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from numba.core import ir
from numba.core.analysis import compute_cfg_from_blocks, compute_use_defs
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.untyped_passes import InlineInlinables


class _NoEnvironments:
    """In place of a code generator: code that is not emitted has no environment to set."""

    def set_env(self, name: str, environment: object) -> None:
        """Do nothing."""


class _CalleeLibrary(JITCodeLibrary):
    """Intermediate code of a kernel; callers link and optimise it."""

    @property
    def codegen(self) -> _NoEnvironments:
        """Receiver of environments."""
        return _NoEnvironments()

    def _optimize_final_module(self) -> None:
        """Leave the code to its callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return name, kind and bitcode."""
        return self.name, "callee", self._get_module_for_linking().as_bitcode()


class _CalleeCacheImpl(CompileResultCacheImpl):
    """Files of callees, beside those of the same kernels with entries."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Return the file name without suffix."""
        return str(super().get_filename_base(fullname, abiflags)) + "-callee"

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> CompileResult:
        """Return a callee from its file."""
        (name, _, bitcode), fndesc, env, signature, objectmode, lifted, notes, init, envs = (
            payload
        )
        library = _CalleeLibrary(target_context.codegen(), name)
        library._final_module = library._shared_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        return CompileResult(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=target_context.get_executable(library, fndesc, env),
            typing_error=None,
            type_annotation=notes,
            signature=signature,
            objectmode=objectmode,
            lifted=lifted,
            fndesc=fndesc,
            library=library,
            call_helper=None,
            environment=env,
            metadata=None,
            reload_init=init,
            referenced_envs=envs,
        )


class _CalleeCache(FunctionCache):
    _impl_class = _CalleeCacheImpl


class _ValueLower(Lower):
    """Keeps variables that are assigned once as values of LLVM, without memory.

    numba does so where all uses lie in one block. It copies all other variables to and from the
    stack: a tuple of a hundred arrays, number by number, at each use. Most of the compilation
    was the removal of these copies.
    """

    def _find_singly_assigned_variable(self) -> None:
        super()._find_singly_assigned_variable()
        blocks = self.func_ir.blocks
        dominators = compute_cfg_from_blocks(blocks).dominators()
        places, uses = defaultdict(list), defaultdict(list)
        for label, block in blocks.items():
            for one in block.find_insts(ir.Assign):
                places[one.target.name].append(label)
        for label, names in compute_use_defs(blocks).usemap.items():
            for name in names:
                uses[name].append(label)
        self._singly_assigned_vars |= {  # blocks are lowered in the order of their labels
            name
            for name, (first, *more) in places.items()
            if not more and all(first < use and first in dominators[use] for use in uses[name])
        }


@register_pass(mutates_CFG=True, analysis_only=False)
class _ValueLowering(NativeLowering):
    _name = "value_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """Class that writes LLVM's code."""
        return _ValueLower


@register_pass(mutates_CFG=True, analysis_only=False)
class _CalleeLowering(_ValueLowering):
    _name = "callee_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower into a library of intermediate code."""
        state.library = _CalleeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


_untyped: dict[Callable[..., Any], Any] = {}
"""Intermediate representation of kernels that were inlined."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _InlineKernels(InlineInlinables):
    """Inline kernels, whose intermediate representation is computed once.

    numba copies a kernel that it inlines twice, block by block, each time with all its
    variables, which took a fifth of the compilation. Here its blocks are copied together once.
    """

    _name = "inline_kernels"

    def _do_work(
        self, state: Any, work_list: Any, block: Any, i: int, expr: Any, inline_worker: Any
    ) -> bool:
        worker, copies = inline_worker, []
        compute = type(worker).run_untyped_passes

        def run_untyped_passes(function: Callable[..., Any]) -> Any:
            if function not in _untyped:
                _untyped[function] = compute(worker, function)
            worker.flags.enable_ssa = False  # as compute does
            copied = _untyped[function].copy()
            copied.blocks = copy.deepcopy(_untyped[function].blocks)
            for one in copied.blocks.values():
                one.__deepcopy__ = lambda _, itself=one: itself
                copies.append(one)
            return copied

        worker.run_untyped_passes = run_untyped_passes
        worker._compiler_pipeline = _untyped_pipeline
        try:
            return bool(super()._do_work(state, work_list, block, i, expr, worker))
        finally:
            for one in copies:
                del one.__deepcopy__


def _with_passes(passes: PassManager, **changed: type) -> PassManager:
    """Return passes where those of some classes are replaced, by class name."""
    passes.passes = [(changed.get(one.__name__, one), text) for one, text in passes.passes]
    passes.finalize()
    return passes


def _untyped_pipeline(state: Any) -> PassManager:
    passes = DefaultPassBuilder.define_untyped_pipeline(state)
    return _with_passes(passes, InlineInlinables=_InlineKernels)


class _QuickFlags(Flags):
    """Flags of a compilation; numba compares them for each call of a built-in function."""

    def __hash__(self) -> int:
        return hash(frozenset(self._values))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _QuickFlags) and bool(self._values == other._values)


class _EntryCompiler(CompilerBase):
    """Compiles a kernel with an entry for Python."""

    changed: dict[str, type] = {
        "InlineInlinables": _InlineKernels,
        "NativeLowering": _ValueLowering,
    }

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        return [_with_passes(passes, **self.changed)]


class _CalleeCompiler(_EntryCompiler):
    """Compiles a kernel for other kernels."""

    changed = {**_EntryCompiler.changed, "NativeLowering": _CalleeLowering}


class Kernel(CPUDispatcher):
    """Compiled function; other kernels that call it see its callee."""

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict[str, Any] | None = None,
        targetoptions: dict[str, Any] | None = None,
    ) -> None:
        options = {**(targetoptions or {}), "nopython": True, "no_cfunc_wrapper": True}
        alone = {**options, "no_cpython_wrapper": True}
        self._callee = CPUDispatcher(
            py_func, locals, targetoptions=alone, pipeline_class=_CalleeCompiler
        )
        self._callee._cache = _CalleeCache(py_func)
        super().__init__(py_func, locals, targetoptions=options, pipeline_class=_EntryCompiler)
        for one in (self, self._callee):
            one._compiler._customize_flags = _QuickFlags
        self.enable_caching()

    @property
    def _type(self) -> Any:
        return self._callee._type

    @_type.setter
    def _type(self, value: Any) -> None:
        """Keep the callee's type, which numba sees where a kernel is called."""

    @property
    def _numba_type_(self) -> Any:
        return self._callee._type

    def compile(self, sig: Any) -> Callable[..., Any]:
        """Return the entry for a signature; compiled where it is new."""
        known = len(self.overloads)
        entry: Callable[..., Any] = super().compile(sig)
        if len(self.overloads) > known:
            compiled = next(reversed(self.overloads.values()))
            for env in compiled._find_referenced_environments():
                compiled.library.codegen.set_env(env.env_name, env)
        return entry
