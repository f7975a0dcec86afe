"""The packages of the wheel: every folder of sarcl/, and kernels/ as sarcl.kernels. All else is in pyproject.toml."""

from setuptools import find_packages, setup

setup(packages=[*find_packages(include=["sarcl", "sarcl.*"]), "sarcl.kernels"])
