"""Bring machine code into this process."""

from __future__ import annotations

import sys
from ctypes import c_void_p
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any

from llvmlite import binding

if TYPE_CHECKING:
    from types import ModuleType

    from .code import Code

_lock = RLock()
_linked: dict[str, int] = {}
"""Addresses of entries."""


def address_of(code: Code) -> int:
    """Link machine code, and return where it begins.

    Raises
    ------
    LookupError
        If it calls something that this process does not have: to go on would end the process.
    """
    with _lock:
        engine = _engine()
        if missing := [name for name in code.externals if not binding.address_of_symbol(name)]:
            raise LookupError(", ".join(missing))
        if code.entry not in _linked:
            engine.add_object_file(binding.ObjectFileRef.from_data(code.machine))
            engine.finalize_object()
            c_void_p.from_address(engine.get_global_value_address(code.environment)).value = id(_environment())
            _linked[code.entry] = engine.get_function_address(code.entry)
    return _linked[code.entry]


@cache
def _environment() -> Any:
    """Return what an entry asks for, and what those of kernels do not use."""
    return _extension("numba._dynfunc").Environment({})


@cache
def _engine() -> Any:
    """Return what links, knowing the functions of C that Numba's code calls."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    for name, address in _extension("numba.core.runtime._nrt_python").c_helpers.items():
        binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
    for name, address in _extension("numba._helperlib").c_helpers.items():
        binding.add_symbol(name, address)  # functions of mathematics go by their own names
        binding.add_symbol(f"numba_{name}", address)
    target = binding.Target.from_triple(binding.get_process_triple())
    machine = target.create_target_machine(codemodel="jitdefault", jit=True)
    return binding.create_mcjit_compiler(binding.parse_assembly(""), machine)


def _extension(name: str) -> ModuleType:
    """Import a library of Numba written in C without Numba; if Numba is imported later, it finds it there."""
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, _file_of(name), loader=ExtensionFileLoader(name, str(_file_of(name))))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return sys.modules.setdefault(name, module)


def _file_of(name: str) -> Path:
    package, *inner = name.split(".")
    spec = find_spec(package)
    folders = spec.submodule_search_locations if spec else None
    for folder in folders or ():
        for suffix in EXTENSION_SUFFIXES:
            if (path := Path(folder, *inner[:-1], inner[-1] + suffix)).exists():
                return path
    raise LookupError(name)
