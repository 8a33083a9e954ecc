"""The C half of the numeric core; everything else about the package stands in pyproject.toml."""

from pathlib import Path

from setuptools import Extension, setup

KERNELS = Path("app/numerics/kernels")

setup(
    ext_modules=[
        Extension(
            "app.numerics._native",
            sources=sorted(str(path) for path in KERNELS.glob("*.c")),
            depends=sorted(str(path) for path in KERNELS.glob("*.h")),
            extra_compile_args=["-O3", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi"],
            py_limited_api=True,
            optional=True,  # without a compiler the numpy definitions serve
        )
    ]
)
