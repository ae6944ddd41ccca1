"""Many inputs in one test: `every` is written as `pytest.mark.parametrize`, and a failure says which input it was."""

from __future__ import annotations

import functools
import inspect


def every(names, cases):
    """Run a test for each case; `names` as in `pytest.mark.parametrize`."""
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)

    def decorate(test):
        signature = inspect.signature(test)
        unknown = set(keys) - set(signature.parameters)
        assert not unknown, f"{test.__name__} takes no {unknown}"
        assert cases, "no case, no test"

        @functools.wraps(test)
        def run(*args, **kwargs):
            for case in cases:
                values = (case,) if len(keys) == 1 else case
                try:
                    test(*args, **kwargs, **dict(zip(keys, values, strict=True)))
                except BaseException as error:
                    error.add_note(f"{names} = {case!r}")
                    raise

        rest = [value for name, value in signature.parameters.items() if name not in keys]
        run.__signature__ = signature.replace(parameters=rest)
        return run

    return decorate
