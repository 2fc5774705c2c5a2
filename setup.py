"""Packages of a wheel: mbref and crosscheck, with the folder reports as crosscheck.reports."""

from setuptools import find_packages, setup

REPORTS = ["reports", *(f"reports.{name}" for name in find_packages("reports"))]

setup(
    packages=[
        *find_packages(include=["mbref", "mbref.*", "crosscheck", "crosscheck.*"]),
        *(f"crosscheck.{name}" for name in REPORTS),
    ],
    package_dir={f"crosscheck.{name}": name.replace(".", "/") for name in REPORTS},
)
