"""Verdicts as a JUnit file for test servers: checks that ran alone, with numbers in the failing line."""

from __future__ import annotations

from collections import Counter
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from crosscheck.conformance.suite import CANNOT, EXPECTED, FAIL, OUTSIDE, PASS, RUN, Conformance, sentence_of
from mbref.printable import printable


def junit(conformance: Conformance) -> str:
    """Return the XML text of one test suite: a case for each check that ran, named scene and check.

    Checks that the engine refuses, or that do not apply, are no cases; properties of the suite count them.
    Expected failures are skipped cases with their reason. The hint is the output of the suite. A suite in
    which no check passes in a run has a failed case, since the engine does not conform.
    """
    ran = [v for v in conformance.verdicts if v.status in (PASS, FAIL, EXPECTED)]
    root = Element("testsuites")
    failures = sum(v.status == FAIL for v in ran)
    runs_nothing = not failures and not conformance.conforms
    suite = SubElement(
        root,
        "testsuite",
        name=f"crosscheck.{conformance.engine}",
        tests=str(len(ran) + runs_nothing),
        failures=str(failures + runs_nothing),
        skipped=str(sum(v.status == EXPECTED for v in ran)),
        errors="0",
    )
    properties = SubElement(suite, "properties")
    counts = Counter(verdict.status for verdict in conformance.verdicts)
    about = {"version": conformance.version, "left out": len(conformance.left_out)}
    about |= {status: counts[status] for status in (CANNOT, OUTSIDE)}
    for name, value in about.items():
        SubElement(properties, "property", name=name, value=str(value))
    for verdict in ran:
        case = SubElement(suite, "testcase", classname=verdict.scene, name=verdict.property)
        if verdict.status == FAIL:
            SubElement(case, "failure", message=sentence_of(verdict)).text = conformance.hint
        elif verdict.status == EXPECTED:
            SubElement(case, "skipped", message=sentence_of(verdict))
    if runs_nothing:
        case = SubElement(suite, "testcase", classname=conformance.engine, name=RUN)
        SubElement(
            case, "failure", message="the engine runs no scene, or the time budget left out all scenes"
        )
    if conformance.hint:
        SubElement(suite, "system-out").text = conformance.hint
    for element in root.iter():
        element.attrib.update({name: printable(text) for name, text in element.attrib.items()})
        element.text = printable(element.text) if element.text else None
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode") + "\n"
